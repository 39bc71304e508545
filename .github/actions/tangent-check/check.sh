#!/usr/bin/env bash
# Checks the tangent of a law and writes its reports. action.yml says what the variables mean.
set -euo pipefail

fail() {
    echo "::error title=tangent-check::$1"
    exit 2
}

case $INTERFACE in
umat) law=(--umat) ;;
mfront | c)
    [ -n "$NAME" ] || fail "The interface $INTERFACE needs the input name."
    law=("--$INTERFACE" "$NAME")
    ;;
*) fail "The input interface is '$INTERFACE'. Allowed are umat, mfront and c." ;;
esac
case $STRICT in
true) law+=(--strict) ;;
false) ;;
*) fail "The input strict is '$STRICT'. Allowed are true and false." ;;
esac
[ -z "$PROPERTIES" ] || law+=("--properties=$PROPERTIES")
[ -z "$STATE" ] || law+=("--state=$STATE")
[ -z "$TANGENT" ] || law+=("--tangent=$TANGENT")
[ -z "$SOURCE" ] || law+=("--source=$SOURCE")
while IFS= read -r option; do
    [ -z "$option" ] || law+=("$option")
done <<<"$OPTIONS"

mkdir -p "$REPORTS"
summary=$REPORTS/summary.md
# Reports of an earlier step must not stand for this one.
rm -f "$summary" "$REPORTS/junit.xml" "$REPORTS/results.sarif"
code=0
bfree check-law "$LIBRARY" "${law[@]}" --report terminal --report github --report "markdown=$summary" \
    --report "junit=$REPORTS/junit.xml" --report "sarif=$REPORTS/results.sarif" || code=$?
echo "exit-code=$code" >>"$GITHUB_OUTPUT"
if [ -s "$summary" ]; then
    cat "$summary" >>"$GITHUB_STEP_SUMMARY"
else
    echo "::error title=tangent-check::bfree ended with exit code $code and wrote no report."
    # No report is no success.
    [ "$code" -ne 0 ] || code=3
fi
exit "$code"

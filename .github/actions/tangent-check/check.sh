#!/usr/bin/env bash
# Checks the tangent of a law and writes its reports. action.yml says what the variables mean.
set -euo pipefail

summary=
problem="The action ended before the check."

# Every exit leaves its code and a summary.
finish() {
    code=$?
    if [ -n "$summary" ] && [ -s "$summary" ]; then
        cat "$summary" >>"$GITHUB_STEP_SUMMARY"
    else
        # No report is no success.
        [ "$code" -ne 0 ] || code=2
        echo "::error title=tangent-check::$problem"
        printf '## Tangent check\n\nNot checked, exit code %s. %s\n' "$code" "$problem" >>"$GITHUB_STEP_SUMMARY"
    fi
    echo "exit-code=$code" >>"$GITHUB_OUTPUT"
    exit "$code"
}
trap finish EXIT

fail() {
    problem=$1
    exit 2
}

law=()
while IFS= read -r file; do
    [ -z "$file" ] || law+=("$file")
done <<<"$FILES"
case $INTERFACE in
umat) law+=(--umat) ;;
mfront | c)
    [ -n "$NAME" ] || fail "The interface $INTERFACE needs the input name."
    law+=("--$INTERFACE" "$NAME")
    ;;
*) fail "The input interface is '$INTERFACE'. Allowed are umat, mfront and c." ;;
esac
case $ALLOW in
"") ;;
inexact) law+=(--allow inexact) ;;
*) fail "The input allow is '$ALLOW'. Allowed is inexact." ;;
esac
[ -z "$PROPERTIES" ] || law+=("--properties=$PROPERTIES")
[ -z "$STATE" ] || law+=("--state=$STATE")
[ -z "$TANGENT" ] || law+=("--tangent=$TANGENT")
[ -z "$SOURCE" ] || law+=("--source=$SOURCE")
while IFS= read -r option; do
    [ -z "$option" ] || law+=("$option")
done <<<"$OPTIONS"

if ! command -v tangent-check >/dev/null; then
    problem="The wheel $WHEEL could not be installed by pip."
    place=$(mktemp -d)
    python3 -m venv "$place"
    "$place/bin/pip" install --quiet "$WHEEL"
    PATH=$place/bin:$PATH
fi

mkdir -p "$REPORTS"
summary=$REPORTS/summary.md
# Reports of an earlier step must not stand for this one.
rm -f "$summary" "$REPORTS/junit.xml" "$REPORTS/results.sarif"
problem="tangent-check wrote no report."
messages=$(mktemp)
code=0
tangent-check "${law[@]}" --report terminal --report github --report "markdown=$summary" --report "junit=$REPORTS/junit.xml" \
    --report "sarif=$REPORTS/results.sarif" 2>"$messages" || code=$?
cat "$messages" >&2
# The last line that the program wrote is the reason if there is no report.
reason=$(grep -a '^error:' "$messages" | tail -n 1 || true)
[ -z "$reason" ] || problem="$reason"
exit "$code"

#!/usr/bin/env python3
"""Validates the reports beside this file with the schemas of their formats.

validate.py SARIF_SCHEMA JUNIT_SCHEMA, with the packages jsonschema and lxml:
- sarif-schema-2.1.0.json of github.com/oasis-tcs/sarif-spec,
- junit-10.xsd of github.com/jenkinsci/xunit-plugin."""
import json
import sys
import xml.etree.ElementTree
from pathlib import Path

import jsonschema
from lxml import etree

here = Path(__file__).parent
own = json.loads((here / "../../src/report/json.schema.json").read_text())
sarif = json.loads(Path(sys.argv[1]).read_text())
junit = etree.XMLSchema(etree.parse(sys.argv[2]))

for path in sorted(here.glob("*.json")):
    jsonschema.Draft202012Validator(own).validate(json.loads(path.read_text()))
    print("valid", path.name)
for path in sorted(here.glob("*.sarif")):
    log = json.loads(path.read_text())
    kind = jsonschema.validators.validator_for(sarif)
    kind(sarif, format_checker=kind.FORMAT_CHECKER).validate(log)
    print("valid", path.name, len(log["runs"][0]["results"]), "results")
for path in sorted(here.glob("*.xml")):
    junit.assertValid(etree.parse(path))
    root = xml.etree.ElementTree.parse(path).getroot()
    print("valid", path.name, len(root.findall(".//testcase")), "tests,", len(root.findall(".//failure")), "failures")

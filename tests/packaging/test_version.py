"""What several files tell of the package is one: its version, and what archives are told of it."""

import json
import re
import tomllib

from tools import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
ARCHIVES = {
    name: json.loads((ROOT / name).read_text()) for name in ("codemeta.json", ".zenodo.json")
}
CITATION = (ROOT / "CITATION.cff").read_text()


def test_the_version_is_the_same_everywhere():
    cited = re.search(r"^version: (\S+)$", CITATION, re.MULTILINE)
    changed = re.search(r"^## (\S+) \(", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert cited
    assert changed
    told = {archive["version"] for archive in ARCHIVES.values()}
    assert {cited[1], changed[1], *told} == {PROJECT["version"]}


def test_archives_are_told_what_the_package_says():
    doi = re.search(r"doi: (\S+)", CITATION)
    assert doi
    for name, archive in ARCHIVES.items():
        text = (ROOT / name).read_text()
        assert archive["description"] == PROJECT["description"], name
        assert archive["keywords"] == PROJECT["keywords"], name
        assert PROJECT["license"] in archive["license"], name
        assert all(f'"{author["name"]}"' in text for author in PROJECT["authors"]), name
        assert doi[1] in text, name
    assert PROJECT["requires-python"] in ARCHIVES["codemeta.json"]["runtimePlatform"]

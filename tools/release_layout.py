# SPDX-License-Identifier: Apache-2.0
"""Write the project as a ROS distribution requires it: one folder per package, none in another.

    python tools/release_layout.py FOLDER

colcon and bloom stop at the first package.xml of a folder and never find msg_defs/ below it. In
the layout beside it: FOLDER holds control_board_ros, control_board_msgs, and
yarp_control_msgs, which no distribution has. Each has LICENSE and CHANGELOG.rst; maintainer and
version are those of the root's package.xml. What was written is checked by catkin_pkg, and by what
bloom requires.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.packages import find_packages, verify_equal_package_versions

ROOT = Path(__file__).resolve().parents[1]
NAME = "control_board_ros"
#: Packages of their own in the layout, and where they are here.
BESIDE = {"control_board_msgs": "msg_defs", "yarp_control_msgs": "vendor/yarp_control_msgs"}
#: Not for who installs a package.
LEFT_OUT = (
    ".ci/",
    ".github/",
    ".devcontainer/",
    "msg_defs/",
    "vendor/",
    "benchmark/",
    "integrations/",
)
LINK, CODE = re.compile(r"\[([^\]]+)\]\([^)]+\)"), re.compile(r"`([^`]+)`")


def changelog(markdown: str, version: str, date: str) -> str:
    """CHANGELOG.md as bloom reads it; what is not released yet is of this version,
    or forthcoming where that is released.

    Args:
        markdown: With a heading ``## Unreleased`` or ``## 1.2.3`` above each list.
        version: Of the release.
        date: Of the release, ``2026-01-31``.
    """
    title = f"Changelog for package {NAME}"
    lines = ["^" * len(title), title, "^" * len(title), ""]
    inside = False
    for line in markdown.splitlines():
        heading = re.match(r"## (?:\[?(\d\S*?)\]?(?: \D*(\d{4}-\d\d-\d\d)\D*)?|Unreleased)$", line)
        if heading:
            text = f"{heading[1] or version} ({heading[2] or date})"
            if heading[1] is None and f"\n## {version}" in markdown:
                text = "Forthcoming"
            lines += ["", text, "-" * len(text), ""]
            inside = True
        elif inside and line.startswith(("- ", "  ")):
            plain = LINK.sub(r"\1", line.replace("\\", "\\\\"))
            # Names that end in _, and *, mean something to RST outside of code.
            parts = CODE.split(plain)
            outside = [re.sub(r"([*|_])", r"\\\1", part) for part in parts[::2]]
            code = [f"``{part}``" for part in parts[1::2]] + [""]
            joined = "".join(a + b for a, b in zip(outside, code, strict=True))
            lines.append("* " + joined[2:] if line.startswith("- ") else joined)
    return "\n".join(lines) + "\n"


def _tag(text: str, tag: str) -> str:
    found = re.search(rf"<{tag}\b.*?</{tag}>", text, re.S)
    assert found is not None, f"package.xml has no {tag}"
    return found[0]


def described(text: str, of: str) -> str:
    """A package.xml with version and maintainer of another, and its license file beside it."""
    for tag in ("version", "maintainer"):
        text = text.replace(_tag(text, tag), _tag(of, tag))
    return re.sub(r"<license>", '<license file="LICENSE">', text)


def root_package(text: str) -> str:
    """The root's package.xml, with the packages beside it as dependencies."""
    for tag, name in (
        ("buildtool_depend", "ament_cmake"),
        ("build_depend", "rosidl_default_generators"),
    ):
        text = text.replace(f"  <{tag}>{name}</{tag}>\n", "")
    first = "  <depend>action_msgs</depend>\n"
    assert first in text
    return text.replace(first, first + "".join(f"  <depend>{name}</depend>\n" for name in BESIDE))


def write(folder: Path) -> None:
    """Write the layout into a folder that is not there yet, or empty."""
    if folder.exists() and any(folder.iterdir()):
        raise SystemExit(f"{folder} is not empty; name a new folder")
    files = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split("\0")
    for name in files:
        if name and not name.startswith(LEFT_OUT) and (ROOT / name).is_file():
            target = folder / NAME / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target)
    for name, place in BESIDE.items():
        shutil.copytree(ROOT / place, folder / name)
        if not (folder / name / "LICENSE").is_file():
            shutil.copy2(ROOT / "LICENSE", folder / name)
    own = (ROOT / "package.xml").read_text("utf-8")
    (folder / NAME / "package.xml").write_text(root_package(own), "utf-8")
    version = re.sub("<.*?>", "", _tag(own, "version"))
    date = re.search(r"date-released: (\S+)", (ROOT / "CITATION.cff").read_text("utf-8"))
    assert date is not None
    log = changelog((ROOT / "CHANGELOG.md").read_text("utf-8"), version, date[1])
    for name in (NAME, *BESIDE):
        package = folder / name / "package.xml"
        package.write_text(described(package.read_text("utf-8"), own), "utf-8")
        (folder / name / "CHANGELOG.rst").write_text(log, "utf-8")


def problems(folder: Path) -> list[str]:
    """What a ROS distribution would refuse: catkin_pkg's own rules, and bloom's."""
    packages = find_packages(str(folder), warnings=(found := []))
    if missing := {NAME, *BESIDE} - {package.name for package in packages.values()}:
        return [f"catkin_pkg does not find {', '.join(sorted(missing))}"]
    try:
        version = verify_equal_package_versions(packages.values())
    except RuntimeError as error:
        return [str(error)]
    for place, package in packages.items():
        with warnings.catch_warnings():  # catkin_pkg's, of docutils
            warnings.simplefilter("ignore", DeprecationWarning)
            log = get_changelog_from_path(str(folder / place))
        if log is None or version not in [entry[0] for entry in log.foreach_version()]:
            found.append(f"{package.name}: CHANGELOG.rst has no {version}")
        found += [
            f"{package.name}: no license file {one.file} beside package.xml"
            for one in package.licenses
            if not one.file or not (folder / place / one.file).is_file()
        ]
        found += [
            f"{package.name}: {person.name} <{person.email}> is no maintainer to write to"
            for person in package.maintainers
            if person.email.endswith("@example.org")
        ]
        found += [
            f"{package.name}: {one.name} is of pip and not optional"
            for one in package.build_depends + package.exec_depends + package.buildtool_depends
            if one.name.endswith("-pip") and one.condition is None
        ]
    return found


def main(argv: list[str] | None = None) -> int:
    """Write and check; 0 where nothing is wrong."""
    parser = argparse.ArgumentParser(description="Write the layout of a release.")
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args(argv).folder
    write(folder)
    wrong = problems(folder)
    for line in wrong:
        print(line, file=sys.stderr)
    if not wrong:
        print(f"{folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

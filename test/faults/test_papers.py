# SPDX-License-Identifier: Apache-2.0
"""The fault catalogue and the security policy are whole, and say what the product does."""

from __future__ import annotations

import ast
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import pytest

from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.interface import Endpoint
from control_board_ros.sim.injection import KINDS

ROOT = Path(__file__).parents[2]
CATALOGUE = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")
SECTIONS = {
    int(number): (title.strip(), body)
    for number, title, body in re.findall(
        r"^## (\d+) (.+)\n((?:(?!^## ).*\n?)*)", CATALOGUE, re.MULTILINE
    )
}


@pytest.mark.parametrize("code", FaultCode)
def test_every_fault_has_its_section(code: FaultCode) -> None:
    """Number, title, and how it is found, cleared and provoked."""
    title, body = SECTIONS[code]
    assert title == code.title
    for word in ("What", "Found within", "Clear", "Provoke"):
        assert re.search(rf"^- \*\*{word}\*\*: .{{4,}}", body, re.MULTILINE), word
    assert "FORCE_IDLE" in body


def test_the_catalogue_has_no_other_section_and_names_every_injection() -> None:
    assert set(SECTIONS) == set(FaultCode)
    assert list(SECTIONS) == sorted(SECTIONS)
    for kind in KINDS:
        assert f"`{kind}`" in CATALOGUE


# --- the security page ------------------------------------------------------------------------

FORBIDDEN = {"eval", "exec", "compile", "__import__", "system", "popen", "urlopen", "Unpickler"}
#: Of patterns, and of MuJoCo's models: neither makes code of a text.
COMPILERS = {"re.compile", "self.spec.compile", "world.compile"}
#: Of yaml.
UNSAFE_LOADS = {"load", "full_load", "unsafe_load"}
UNSAFE_MODULES = {"pickle", "marshal", "shelve", "urllib.request", "requests", "http.client"}


@pytest.mark.slow
def test_nothing_is_evaluated_unpickled_or_fetched() -> None:
    """What docs/security.md says of the sources."""
    sources = sorted((ROOT / "control_board_ros").rglob("*.py"))
    assert len(sources) > 50
    for path in sources:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names: set[str] = set()
            if isinstance(node, ast.Call):
                called = node.func
                plain = called.id if isinstance(called, ast.Name) else ""
                owned = called.attr if isinstance(called, ast.Attribute) else ""
                names = {plain, owned} & FORBIDDEN
                if owned in FORBIDDEN | UNSAFE_LOADS:
                    whole = ast.unparse(called)
                    names = set() if whole in COMPILERS else names
                    names |= {whole} & {f"yaml.{load}" for load in UNSAFE_LOADS}
            elif isinstance(node, ast.Import):
                names = {alias.name for alias in node.names} & UNSAFE_MODULES
            elif isinstance(node, ast.ImportFrom):
                names = {node.module or ""} & UNSAFE_MODULES if node.level == 0 else set()
            assert not names, f"{path}:{getattr(node, 'lineno', 0)}: {names}"


# --- the policy -------------------------------------------------------------------------------

POLICY = ET.parse(ROOT / "config" / "control_board.policy.xml").getroot()
#: The schema of SROS2 policies, version 0.2.0: children and attributes of each element.
CHILDREN = {
    "policy": {"enclaves"},
    "enclaves": {"enclave"},
    "enclave": {"profiles"},
    "profiles": {"profile"},
    "profile": {"topics", "services", "actions"},
    "topics": {"topic"},
    "services": {"service"},
    "actions": {"action"},
    "topic": set(),
    "service": set(),
    "action": set(),
}
ATTRIBUTES = {
    "policy": {"version"},
    "enclave": {"path"},
    "profile": {"ns", "node"},
    "topics": {"publish", "subscribe"},
    "services": {"reply", "request"},
    "actions": {"call", "execute"},
}
NAME = re.compile(r"(~?/)?[a-z][A-Za-z0-9_]*(/[a-z][A-Za-z0-9_]*)*$")


def granted(enclave: str, group: str, right: str) -> set[str]:
    """Absolute names that an enclave may use in a way."""
    found = set()
    for profile in POLICY.iterfind(f"enclaves/enclave[@path='{enclave}']/profiles/profile"):
        node = f"{profile.get('ns', '').rstrip('/')}/{profile.get('node')}"
        for names in profile.iterfind(group):
            if names.get(right) == "ALLOW":
                texts = [name.text or "" for name in names]
                found |= {re.sub(r"^~", node, t) if t[0] in "~/" else f"/{t}" for t in texts}
    return found


def test_the_policy_obeys_its_schema() -> None:
    """Elements, attributes, values and their number, as the SROS2 tools check them."""
    assert POLICY.tag == "policy"
    assert POLICY.get("version") == "0.2.0"
    assert len(POLICY) == 1
    for element in POLICY.iter():
        tag = element.tag
        children = CHILDREN[tag]
        assert {child.tag for child in element} <= children
        assert len(element) > 0 or not children, tag
        assert set(element.attrib) <= ATTRIBUTES.get(tag, set())
        if tag in ("topics", "services", "actions"):
            assert len(element.attrib) == 1
            assert set(element.attrib.values()) <= {"ALLOW", "DENY"}
            names = [child.text for child in element]
            assert len(names) == len(set(names))
        elif tag in ATTRIBUTES:
            assert set(element.attrib) == ATTRIBUTES[tag]
        if not children:
            assert NAME.match(element.text or ""), element.text


def test_the_board_has_only_the_permissions_it_uses() -> None:
    """Every topic and service of the node, as interface.py has them, with what is optional."""
    from control_board_ros.interface import (
        ACTIONS,
        COMMAND_TOPICS,
        LIFECYCLE,
        PUBLISHED,
        SERVICES,
        YARP,
    )

    optional = (*LIFECYCLE, *YARP)

    def of(kind: str, always: Sequence[Endpoint]) -> set[str]:
        more = [one for one in optional if one.kind == kind]
        return {one.of(board) for one in (*always, *more)}

    board = "/control_board"
    standard = {
        "describe_parameters",
        "get_parameter_types",
        "get_parameters",
        "list_parameters",
        "set_parameters",
        "set_parameters_atomically",
        "get_type_description",
    }
    assert granted(board, "services", "reply") == {
        *of("service", SERVICES),
        *(f"{board}/{name}" for name in standard),
    }
    assert granted(board, "topics", "subscribe") == {
        *of("command", COMMAND_TOPICS),
        "/clock",
        "/parameter_events",
    }
    assert granted(board, "topics", "publish") == {
        *of("topic", PUBLISHED),
        "/rosout",
        "/parameter_events",
    }
    assert granted(board, "actions", "execute") == {action.of(board) for action in ACTIONS}


@pytest.mark.parametrize("profile", ["operator", "monitor"])
def test_other_nodes_may_use_the_interface_of_the_board(profile: str) -> None:
    """The board alone offers all that a profile calls or subscribes to."""
    board, own = "/control_board", f"/control_board/{profile}"
    both = {"/rosout", "/parameter_events"}
    assert f"{board}/state" in granted(own, "topics", "subscribe")
    for group, theirs, ours in (
        ("services", "request", "reply"),
        ("actions", "call", "execute"),
        ("topics", "publish", "subscribe"),
        ("topics", "subscribe", "publish"),
    ):
        assert granted(own, group, theirs) <= granted(board, group, ours) | both
    assert not granted(own, "services", "reply")
    assert not granted(own, "actions", "execute")
    forbidden = {f"{board}/inject_fault", f"{board}/set_parameters", f"{board}/external_torque"}
    assert not forbidden & granted(own, "services", "request") | (
        forbidden & granted(own, "topics", "publish")
    )


def test_a_monitor_sees_everything_and_changes_nothing() -> None:
    """It calls getters only, and publishes nothing that a board subscribes to."""
    own = "/control_board/monitor"
    seen = granted("/control_board", "topics", "publish") - {"/rosout"}
    assert granted(own, "topics", "subscribe") == seen
    called = granted(own, "services", "request")
    assert "/control_board/get_control_mode" in called
    assert all("/get_" in name or name.endswith("/list_poses") for name in called)
    assert granted(own, "topics", "publish") == {"/rosout", "/parameter_events"}
    assert not granted(own, "actions", "call")

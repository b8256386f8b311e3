# SPDX-License-Identifier: Apache-2.0
"""The object dictionary that master and simulated drives share: what CiA 402 needs, and four PDOs.

RPDO1  control word, mode, target torque           TPDO1  status word, position, torque
RPDO2  target position, target velocity            TPDO2  velocity, error code

All of them are synchronous, type 1: drives act on each SYNC, and answer to it.
"""

from __future__ import annotations

from canopen.objectdictionary import ObjectDictionary, ODArray, ODRecord, ODVariable, datatypes

U8, U16, U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
I8, I16, I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32
BITS = {U8: 8, U16: 16, U32: 32, I8: 8, I16: 16, I32: 32}

DEVICE_TYPE, CYCLE_PERIOD = 0x1000, 0x1006
ERROR_CODE, CONTROL, STATUS = 0x603F, 0x6040, 0x6041
MODE, POSITION, VELOCITY, TORQUE = 0x6060, 0x6064, 0x606C, 0x6077
TARGET_TORQUE, TARGET_POSITION, TARGET_VELOCITY = 0x6071, 0x607A, 0x60FF
#: A servo drive (2) after profile 402.
SERVO = 0x00020192

VARIABLES = {
    DEVICE_TYPE: ("Device type", U32, SERVO),
    CYCLE_PERIOD: ("Communication cycle period", U32, 2000),  # µs
    ERROR_CODE: ("Error code", U16, 0),
    CONTROL: ("Controlword", U16, 0),
    STATUS: ("Statusword", U16, 0x40),
    MODE: ("Modes of operation", I8, 10),
    POSITION: ("Position actual value", I32, 0),  # counts
    VELOCITY: ("Velocity actual value", I32, 0),  # counts/s
    TARGET_TORQUE: ("Target torque", I16, 0),  # per mille of the rated torque
    TORQUE: ("Torque actual value", I16, 0),
    TARGET_POSITION: ("Target position", I32, 0),
    TARGET_VELOCITY: ("Target velocity", I32, 0),
}
RPDOS = ((CONTROL, MODE, TARGET_TORQUE), (TARGET_POSITION, TARGET_VELOCITY))
TPDOS = ((STATUS, POSITION, TORQUE), (VELOCITY, ERROR_CODE))
SYNCHRONOUS = 1


def dictionary(node: int) -> ObjectDictionary:
    """The objects of the drive with this number."""
    made = ObjectDictionary()
    made.node_id = node
    for index, (name, kind, value) in VARIABLES.items():
        made.add_object(_variable(name, index, 0, kind, value))
    for number, mapped in enumerate(RPDOS):
        _add_pdo(made, f"RPDO{number + 1}", 0x1400 + number, 0x200 + 0x100 * number + node, mapped)
    for number, mapped in enumerate(TPDOS):
        _add_pdo(made, f"TPDO{number + 1}", 0x1800 + number, 0x180 + 0x100 * number + node, mapped)
    return made


def _add_pdo(
    made: ObjectDictionary, name: str, index: int, cob_id: int, mapped: tuple[int, ...]
) -> None:
    parameters = ODRecord(f"{name} communication", index)
    for subindex, (what, kind, value) in enumerate(
        (("Highest", U8, 2), ("COB-ID", U32, cob_id), ("Transmission type", U8, SYNCHRONOUS))
    ):
        parameters.add_member(_variable(what, index, subindex, kind, value))
    mapping = ODArray(f"{name} mapping", index + 0x200)
    mapping.add_member(_variable("Number", index + 0x200, 0, U8, len(mapped)))
    for subindex, target in enumerate(mapped, start=1):
        value = target << 16 | BITS[VARIABLES[target][1]]
        mapping.add_member(_variable(f"Object {subindex}", index + 0x200, subindex, U32, value))
    made.add_object(parameters)
    made.add_object(mapping)


def _variable(name: str, index: int, subindex: int, kind: int, value: int) -> ODVariable:
    made = ODVariable(name, index, subindex)
    made.data_type, made.default, made.access_type = kind, value, "rw"
    return made

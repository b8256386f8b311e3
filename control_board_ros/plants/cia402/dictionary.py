# SPDX-License-Identifier: Apache-2.0
"""The object dictionary of a virtual CiA 402 drive: objects, types, values, PDOs as delivered."""

from __future__ import annotations

from canopen.objectdictionary import ObjectDictionary, ODArray, ODRecord, ODVariable, datatypes

from . import objects as o

COUNTS = 1 << 17
ERROR_REGISTER, EMERGENCY_ID, PRODUCER_HEARTBEAT = 0x1001, 0x1014, 0x1017
U8, U16, U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
I8, I16, I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32
TEXT = datatypes.VISIBLE_STRING
#: Index, type, value at start, and whether it may be written.
VARIABLES: tuple[tuple[int, int, int | str, bool], ...] = (
    (o.DEVICE_TYPE, U32, o.SERVO, False),
    (o.DEVICE_NAME, TEXT, "virtual CiA 402", False),
    (o.SOFTWARE, TEXT, "1.0", False),
    (ERROR_REGISTER, U8, 0, False),
    (EMERGENCY_ID, U32, 0x80, True),
    (PRODUCER_HEARTBEAT, U16, 0, True),
    (o.ABORT_OPTION, I16, 0, True),
    (o.ERROR_CODE, U16, 0, False),
    (o.CONTROL, U16, 0, True),
    (o.STATUS, U16, 0x40, False),
    (o.QUICK_STOP_OPTION, I16, 2, True),
    (o.FAULT_OPTION, I16, 2, True),
    (o.MODE, I8, 0, True),
    (o.MODE_DISPLAY, I8, 0, False),
    (o.POSITION, I32, 0, False),
    (o.VELOCITY, I32, 0, False),
    (o.TARGET_TORQUE, I16, 0, True),
    (o.MAX_TORQUE, U16, 2000, True),
    (o.RATED_TORQUE, U32, 2000, False),
    (o.TORQUE, I16, 0, False),
    (o.SUPPLY, U32, 48000, False),
    (o.TARGET_POSITION, I32, 0, True),
    (o.MAX_SPEED, U32, 3000, True),
    (o.TORQUE_OFFSET, I16, 0, True),
    (o.TARGET_VELOCITY, I32, 0, True),
    (o.SUPPORTED_MODES, U32, 0x380, False),
    (o.MOTOR_POSITION, I32, 0, False),
)
ARRAYS: tuple[tuple[int, int, tuple[int, ...], bool], ...] = (
    (o.CONSUMER_HEARTBEAT, U32, (0,), True),
    (o.IDENTITY, U32, (0, 0, 0, 0), False),
    (o.ERROR_BEHAVIOUR, U8, (0,), True),
    (o.POSITION_LIMITS, I32, (0, 0), True),
    (o.RESOLUTION, U32, (COUNTS, 1), False),
)
#: Subindices of a PDO's parameters, type, and value: those of event-driven ones are not sent
#: more often than the inhibit time, 100 µs, and no less often than the event timer, ms.
INHIBIT, EVENT_TIMER = 3, 5


def dictionary(drive: int) -> ObjectDictionary:
    """The objects of a drive with this number, PDOs mapped as its maker left them."""
    made = ObjectDictionary()
    made.node_id = drive
    for index, kind, value, writable in VARIABLES:
        made.add_object(_variable(index, 0, kind, value, writable))
    for index, kind, values, writable in ARRAYS:
        array = ODArray(f"0x{index:04x}", index)
        array.add_member(_variable(index, 0, U8, len(values), writable=False))
        for place, number in enumerate(values, start=1):
            array.add_member(_variable(index, place, kind, number, writable))
        made.add_object(array)
    period = ODRecord(f"0x{o.INTERPOLATION_PERIOD:04x}", o.INTERPOLATION_PERIOD)
    for place, kind, value in ((0, U8, 2), (1, U8, 1), (2, I8, -3)):
        period.add_member(_variable(o.INTERPOLATION_PERIOD, place, kind, value, place > 0))
    made.add_object(period)
    made[EMERGENCY_ID].default = 0x80 + drive
    for function, index in o.PARAMETERS.items():
        only = o.CONTROL if function in (o.RPDO1, o.RPDO2) else o.STATUS
        parameters = ODRecord(f"0x{index:04x}", index)
        mapping = ODRecord(f"0x{index + 0x200:04x}", index + 0x200)
        for place, kind, value in ((0, U8, 5), (1, U32, function + drive), (2, U8, 255),
                                   (INHIBIT, U16, 0), (EVENT_TIMER, U16, 0)):  # fmt: skip
            parameters.add_member(_variable(index, place, kind, value))
        for place, (kind, value) in enumerate(((U8, 1), (U32, only << 16 | 16), *[(U32, 0)] * 7)):
            mapping.add_member(_variable(index + 0x200, place, kind, value))
        made.add_object(parameters)
        made.add_object(mapping)
    return made


def _variable(
    index: int, subindex: int, kind: int, value: int | str, writable: bool = True
) -> ODVariable:
    made = ODVariable(f"0x{index:04x}:{subindex}", index, subindex)
    made.data_type, made.default = kind, value
    made.access_type = "rw" if writable else "ro"
    return made

# SPDX-License-Identifier: Apache-2.0
"""Objects of CiA 301 and CiA 402 that the driver uses, the PDOs that it maps, and error codes.

RPDO1  control word, mode, target torque, torque offset    TPDO1  status word, position, torque
RPDO2  target position, target velocity                    TPDO2  velocity, error code, mode
                                                           TPDO3  position of the motor, optional

All of them are synchronous, type 1: a drive acts on each SYNC, and answers to it.
"""

from __future__ import annotations

DEVICE_TYPE, ERROR_BEHAVIOUR = 0x1000, 0x1029
DEVICE_NAME, SOFTWARE, CONSUMER_HEARTBEAT = 0x1008, 0x100A, 0x1016
IDENTITY, SERIAL = 0x1018, 4
ABORT_OPTION, ERROR_CODE, CONTROL, STATUS = 0x6007, 0x603F, 0x6040, 0x6041
QUICK_STOP_OPTION, FAULT_OPTION = 0x605A, 0x605E
MODE, MODE_DISPLAY = 0x6060, 0x6061
#: Of 0x6061, by their published names.
MODES = {0: "none", 1: "PP", 3: "PV", 4: "PT", 6: "HM", 7: "IP", 8: "CSP", 9: "CSV", 10: "CST"}
POSITION, VELOCITY, TORQUE = 0x6064, 0x606C, 0x6077
TARGET_TORQUE, MAX_TORQUE, RATED_TORQUE = 0x6071, 0x6072, 0x6076
SUPPLY, TARGET_POSITION, POSITION_LIMITS = 0x6079, 0x607A, 0x607D
MAX_SPEED, RESOLUTION, TORQUE_OFFSET = 0x6080, 0x608F, 0x60B2
GEAR_RATIO, FEED_CONSTANT = 0x6091, 0x6092
POSITION_UNIT, VELOCITY_UNIT = 0x60A8, 0x60A9
CYCLE_PERIOD, INTERPOLATION_PERIOD = 0x1006, 0x60C2
TARGET_VELOCITY, SUPPORTED_MODES, MOTOR_POSITION = 0x60FF, 0x6502, 0x6063

#: Profile number in the device type; bit 17 there: a servo drive.
PROFILE, SERVO = 402, 0x00020192
#: Frames: function code, plus the number of the drive where there is one.
NMT, SYNC, TPDO1, RPDO1, TPDO2, RPDO2 = 0x000, 0x080, 0x180, 0x200, 0x280, 0x300
TPDO3 = 0x380
SDO_ANSWER, SDO_REQUEST, HEARTBEAT = 0x580, 0x600, 0x700
#: Commands and states of NMT.
START, PRE_OPERATIONAL, RESET_COMMUNICATION = 0x01, 0x80, 0x82
BOOT_UP, OPERATIONAL = 0x00, 0x05
#: The driver's own number on the bus, in its heartbeat.
MASTER = 0x7F

#: Mapped objects of each PDO, with their bits.
MAPPED: dict[int, tuple[tuple[int, int], ...]] = {
    RPDO1: ((CONTROL, 16), (MODE, 8), (TARGET_TORQUE, 16), (TORQUE_OFFSET, 16)),
    RPDO2: ((TARGET_POSITION, 32), (TARGET_VELOCITY, 32)),
    TPDO1: ((STATUS, 16), (POSITION, 32), (TORQUE, 16)),
    TPDO2: ((VELOCITY, 32), (ERROR_CODE, 16), (MODE_DISPLAY, 8)),
}
#: Communication parameters of each PDO; its mapping is 0x200 further.
PARAMETERS = {RPDO1: 0x1400, RPDO2: 0x1401, TPDO1: 0x1800, TPDO2: 0x1801, TPDO3: 0x1802}
#: That of the motor's encoder, mapped where there is one.
MOTOR = ((MOTOR_POSITION, 32),)
#: How the driver packs and reads them; RPDO1 without a torque offset has two bytes less.
RPDO1_FORMAT, RPDO2_FORMAT, TPDO1_FORMAT, TPDO2_FORMAT = "<Hbhh", "<ii", "<Hih", "<iHb"
ANSWERS = {TPDO1: (1, TPDO1_FORMAT), TPDO2: (2, TPDO2_FORMAT), TPDO3: (4, "<i")}
INVALID, SYNCHRONOUS = 1 << 31, 1

#: Abort connection option, fault reaction, quick stop option.
FAULT_SIGNAL, QUICK_STOP, COAST, STAY_STOPPED = 1, 3, 0, 6

#: SI units (0x60A8, 0x60A9), without their prefix: none, and 1/min of a shaft.
NO_UNIT, PER_MINUTE = 0, 0x00B44700

HEARTBEAT_LOST = 0x8130
#: Names of error codes (0x603F); a code that is not here has the name of its group.
ERRORS = {
    0x2220: "continuous over-current in the drive",
    0x2310: "continuous over-current",
    0x2320: "short circuit or earth leakage at the motor",
    0x2330: "earth leakage",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3130: "phase failure",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x3310: "output over-voltage",
    0x4110: "excess ambient temperature",
    0x4210: "excess temperature of the device",
    0x4310: "excess temperature of the drive",
    0x5112: "control supply low",
    0x5441: "safe torque off, or a limit switch",
    0x5530: "non-volatile memory",
    0x6010: "software watchdog",
    0x6320: "parameter error",
    0x7110: "brake chopper",
    0x7121: "motor blocked",
    0x7122: "motor or commutation",
    0x7300: "sensor",
    0x7305: "incremental sensor 1",
    0x7310: "speed",
    0x7320: "position",
    0x7380: "position sensor",
    0x8110: "CAN overrun",
    0x8120: "CAN in error passive mode",
    HEARTBEAT_LOST: "watchdog: no heartbeat within its timeout",
    0x8140: "CAN recovered from bus off",
    0x8210: "PDO not processed, of wrong length",
    0x8311: "excess torque",
    0x8400: "velocity controller",
    0x8500: "position controller",
    0x8611: "following error",
    0x8612: "reference limit",
    0x8700: "SYNC controller",
    0xFF01: "of the manufacturer",
}
#: By the first hexadecimal digit of a code.
GROUPS = {
    0x2: "current",
    0x3: "voltage",
    0x4: "temperature",
    0x5: "hardware of the device",
    0x6: "software of the device",
    0x7: "additional modules",
    0x8: "monitoring",
    0x9: "external error",
    0xF: "of the manufacturer",
}


def error_name(code: int) -> str:
    return ERRORS.get(code) or f"{GROUPS.get(code >> 12, 'of no group')}; see its manual"

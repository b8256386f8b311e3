# SPDX-License-Identifier: Apache-2.0
"""Registers of a Damiao motor under the maker's names, as a J4310 leaves the factory.

Names, access and ranges: register list of the maker's manual DM-J4310-2EC, as damiao-motor 1.0.6
(core/motor.py) and motorbridge 0.5.6 (damiao_registers.py) have it too. Motor's figures: the
table of parameters of the J4310-2EC V1.1 (wiki.seeedstudio.com/damiao_series). A write acts at
once and is lost with the supply, until 0xAA stores it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

#: Largest float of four bytes.
MOST = 3.4e38


class Register(NamedTuple):
    """A register.

    Attributes:
        name: The maker's.
        form: Of its four bytes: ``f``, or ``I`` for a whole number.
        value: At delivery.
        low, high: Values that it accepts, ends included; NaN: it is read only.
    """

    name: str
    form: str
    value: float
    low: float = math.nan
    high: float = math.nan

    @property
    def writable(self) -> bool:
        return not math.isnan(self.low)


REGISTERS = {
    0: Register("UV_Value", "f", 15.0, 10.0, MOST),
    1: Register("KT_Value", "f", 0.945, 0.0, MOST),
    2: Register("OT_Value", "f", 100.0, 80.0, 200.0),
    3: Register("OC_Value", "f", 0.98, 0.0, 1.0),
    4: Register("ACC", "f", 2.0, 0.0, MOST),
    5: Register("DEC", "f", -2.0, -MOST, 0.0),
    6: Register("MAX_SPD", "f", 30.0, 0.0, MOST),
    7: Register("MST_ID", "I", 0x11, 0, 0x7FF),
    8: Register("ESC_ID", "I", 0x01, 0, 0x7FF),
    9: Register("TIMEOUT", "I", 0, 0, 2**32 - 1),
    10: Register("CTRL_MODE", "I", 2, 1, 4),
    11: Register("Damp", "f", 0.0),
    12: Register("Inertia", "f", 1.8e-5),
    13: Register("hw_ver", "I", 1),
    14: Register("sw_ver", "I", 5013),
    15: Register("SN", "I", 1),
    16: Register("NPP", "I", 14),
    17: Register("Rs", "f", 0.85),
    18: Register("Ls", "f", 345e-6),
    19: Register("Flux", "f", 0.0045),
    20: Register("Gr", "f", 10.0),
    21: Register("PMAX", "f", 12.5, 0.0, MOST),
    22: Register("VMAX", "f", 30.0, 0.0, MOST),
    23: Register("TMAX", "f", 10.0, 0.0, MOST),
    24: Register("I_BW", "f", 1000.0, 100.0, 10000.0),
    25: Register("KP_ASR", "f", 3.72e-4, 0.0, MOST),
    26: Register("KI_ASR", "f", 0.002, 0.0, MOST),
    27: Register("KP_APR", "f", 50.0, 0.0, MOST),
    28: Register("KI_APR", "f", 0.0, 0.0, MOST),
    29: Register("OV_Value", "f", 32.0, 0.0, MOST),
    30: Register("GREF", "f", 1.0, 0.0, 1.0),
    31: Register("Deta", "f", 4.0, 1.0, 30.0),
    32: Register("V_BW", "f", 40.0, 0.0, 500.0),
    33: Register("IQ_c1", "f", 100.0, 100.0, 10000.0),
    34: Register("VL_c1", "f", 10.0, 0.0, 10000.0),
    35: Register("can_br", "I", 4, 0, 4),
    36: Register("sub_ver", "I", 0),
    50: Register("u_off", "f", 0.0),
    51: Register("v_off", "f", 0.0),
    52: Register("k1", "f", 1.0),
    53: Register("k2", "f", 1.0),
    54: Register("m_off", "f", 0.0),
    55: Register("dir", "f", 1.0),
    56: Register("m_off", "f", 0.0),
    59: Register("Imax", "f", 10.261194),
    60: Register("VBus", "f", 24.0),
    61: Register("Tpcb", "f", 30.0),
    62: Register("Tmtr", "f", 35.0),
    63: Register("Iu_off", "f", 0.0),
    64: Register("Iv_off", "f", 0.0),
    65: Register("Iw_off", "f", 0.0),
    80: Register("p_m", "f", 0.0),
    81: Register("xout", "f", 0.0),
}
BRIDGE_HEAT, WINDING_HEAT, MOTOR_POSITION, OUTPUT_POSITION = 61, 62, 80, 81
GEAR, SPEED_GAIN, POSITION_GAIN = 20, 25, 27
#: V: UV_Value, below which it is in under-voltage, and VBus, as measured.
LEAST_SUPPLY, SUPPLY = 0, 60

# SPDX-License-Identifier: Apache-2.0
"""A switch in user space: frames go to all other ports, later, and some get lost.

usage: switch.py LOSS DELAY PORT...

Each port is a TAP device of that name; it may be moved to another network namespace. On stdin it
takes lines, and answers each: `cut FROM TO` lets nothing through in this direction from now on,
and `join FROM TO` everything again; ports by their number.
"""

from __future__ import annotations

import fcntl
import heapq
import itertools
import os
import random
import select
import struct
import sys
import time

TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
LONGEST = 65536


def port(name: str) -> int:
    """A new TAP device; its file."""
    file = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(file, TUNSETIFF, struct.pack("16sH", name.encode(), IFF_TAP | IFF_NO_PI))
    return file


def main(loss: float, delay: float, names: list[str]) -> None:
    """Carry frames until the process is terminated."""
    ports = [port(name) for name in names]
    chance, order = random.Random(7), itertools.count()
    waiting: list[tuple[float, int, int, bytes]] = []  # when, order, from, frame
    closed = set[tuple[int, int]]()
    print('{"ready": true}', flush=True)
    while True:
        patience = max(waiting[0][0] - time.monotonic(), 0.0) if waiting else None
        for source in select.select([*ports, sys.stdin], [], [], patience)[0]:
            if source is sys.stdin:
                word, *numbers = sys.stdin.readline().split()
                way = ports[int(numbers[0])], ports[int(numbers[1])]
                (closed.add if word == "cut" else closed.discard)(way)
                print('{"done": true}', flush=True)
                continue
            try:
                frame = os.read(source, LONGEST)
            except OSError:  # it is down, on its way to a host
                time.sleep(0.001)
                continue
            if chance.random() >= loss:
                heapq.heappush(waiting, (time.monotonic() + delay, next(order), source, frame))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, source, frame = heapq.heappop(waiting)
            for target in ports:
                if target != source and (source, target) not in closed:
                    try:
                        os.write(target, frame)
                    except OSError:  # down, or its queue is full: lost, as on a wire
                        continue


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]), sys.argv[3:])

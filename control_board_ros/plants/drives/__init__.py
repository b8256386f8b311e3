# SPDX-License-Identifier: Apache-2.0
"""What the drivers in the box share: axes, options, one plant for the drives of one bus.

The folder of a driver has two modules::

    driver     make(names, arguments)      the plant of the drives of a bus
               scan(bus)                   the drives that answer on it
    virtual    virtual_drive(axis, joint)  one that fits a joint, tuned by the joint's own gains
               virtual_bus(world, drives)  a bus on which they answer
"""

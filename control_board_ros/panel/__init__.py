# SPDX-License-Identifier: Apache-2.0
"""The web panel: boards of the domain in a browser, for desk and phone (``cbctl panel``).

A program beside the boards, made of three parts: ``boards`` hears them and asks them, through the
client; ``hub`` shares that among the browsers, of which one operates (``operators``, over all
panels of the domain); ``server`` lets browsers in.
The page itself is plain modules in ``page/``.
"""

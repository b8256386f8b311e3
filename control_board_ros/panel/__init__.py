# SPDX-License-Identifier: Apache-2.0
"""The web panel: boards of the domain in a browser, for desk and phone (``cbctl panel``).

A program beside the boards, in three parts: ``boards`` connects to them through the client;
``hub`` serves the browsers, one of which operates (``operators``, over all panels of the domain);
``server`` is the web server. The page itself is plain modules in ``page/``.
"""

#!/usr/bin/env python3
"""Makes the cases and the motion that the system tests share (ctest runs it before them)."""

import os

from arthron import CASES, SOURCE, call

for recipe in ("healthy", "arthrosis"):
    call("arthron-case", "generate", os.path.join(SOURCE, "cases", recipe), "--out", os.path.join(CASES, recipe))
call("arthron-case", "motion", os.path.join(SOURCE, "cases/motions/palpation.ini"), "--case",
     os.path.join(CASES, "healthy"), "--out", os.path.join(CASES, "palpation.csv"))

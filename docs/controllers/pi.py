#!/usr/bin/env python3
"""A controller for `study compare --controller`: PI with one transmission ratio for all loads and twists.

One line of JSON each 10 ms, answered by one (docs/reference/results.md).
"""

import json
import sys

TR_RAD_PER_M, GAIN_PER_S, INTEGRAL_S, TICK_S = 2860.0, 6.0, 1.0, 0.01
AT_REST_M = 10e-6  # an integral beyond friction never comes to rest

integral_m = 0.0
for line in sys.stdin:
    now = json.loads(line)
    error_m = now["set_point_m"] - now["position_m"]
    if abs(error_m) < AT_REST_M:
        error_m = integral_m = 0.0
    integral_m += error_m * TICK_S / INTEGRAL_S
    speed_m_per_s = now["speed_m_per_s"] + GAIN_PER_S * (error_m + integral_m)
    print(json.dumps({"twist_rad_per_s": TR_RAD_PER_M * speed_m_per_s}), flush=True)

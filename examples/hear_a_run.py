"""A channel of a run as sound: 48 kHz, 16 bit, without its moving average, the largest sample 1 dB below full scale.

python examples/hear_a_run.py TRACE CHANNEL sound.wav
"""

from __future__ import annotations

import sys
import wave
from fractions import Fraction

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import resample_poly

from gearfmu.stage import Trace

RATE, AVERAGE = 48_000, 10e-3  # Hz, s
HEADROOM = 10 ** (-1 / 20)

trace = Trace.load(sys.argv[1])
step = float(trace.time[1] - trace.time[0])
values = trace[sys.argv[2]] - uniform_filter1d(np.asarray(trace[sys.argv[2]], float), round(AVERAGE / step))
ratio = Fraction(RATE * step).limit_denominator(1000)
heard = resample_poly(values, ratio.numerator, ratio.denominator)
full_scale = float(np.abs(heard).max()) / HEADROOM
with wave.open(sys.argv[3], "wb") as file:
    file.setnchannels(1)
    file.setsampwidth(2)
    file.setframerate(RATE)
    file.writeframes(np.rint(heard / full_scale * 32767).astype("<i2").tobytes())
unit = trace.channels[sys.argv[2]].unit
print(f"{20 * np.log10(values.std()):.1f} dB re 1 {unit} (rms); full scale is a peak of {full_scale:.4g} {unit}")

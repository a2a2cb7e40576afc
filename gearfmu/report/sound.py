"""A channel of a trace as sound: 48 kHz, 16 bit, one channel, with its level told."""

from __future__ import annotations

import base64
import io
import wave
from dataclasses import dataclass
from fractions import Fraction
from html import escape

import numpy as np
from scipy.signal import resample_poly

from gearfmu.cosim.accuracy import alternating
from gearfmu.report.metrics import level, sample_step
from gearfmu.report.names import shown
from gearfmu.report.plots_nvh import force_channels
from gearfmu.report.signals import SETTLED, window_of_interest
from gearfmu.stage.run.trace import Trace

RATE, LONGEST, FADE = 48_000, 10.0, 5e-3  # Hz, s, s
HEADROOM = 10 ** (-1 / 20)  # the largest sample lies 1 dB below full scale
STEPS = 32767


@dataclass(frozen=True)
class Sound:
    """channel and its unit; samples (n,) int16 at RATE; full_scale: what 32767 stands for, in the unit; rms: of the
    alternating part, in the unit; start, end: of the part of the run, s."""

    channel: str
    unit: str
    samples: np.ndarray
    full_scale: float
    rms: float
    start: float
    end: float

    @property
    def wav(self) -> bytes:
        """The file."""
        buffer = io.BytesIO()
        with wave.open(buffer, "wb") as file:
            file.setnchannels(1)
            file.setsampwidth(2)
            file.setframerate(RATE)
            file.writeframes(self.samples.astype("<i2").tobytes())
        return buffer.getvalue()

    @property
    def caption(self) -> str:
        """Channel, level and what was done to it."""
        unit = self.unit.replace("N.m", "N·m") or "1"
        return (
            f"{shown(self.channel)}, {self.start:.4g} s to {self.end:.4g} s, resampled to 48 kHz, without its mean or "
            f"moving average of 10 ms, faded over 5 ms at both ends. Level {level(self.rms):.1f} dB re 1 {unit} (rms "
            f"{self.rms:.4g} {unit}); full scale, 0 dBFS, is a peak of {self.full_scale:.4g} {unit}, "
            f"{level(self.full_scale):.1f} dB re 1 {unit}. "
        )


def sound_of(trace: Trace, channel: str) -> Sound:
    """A channel over the window of interest, at most LONGEST seconds of it. MetricsError for uneven samples, TraceError
    for a channel that there is not."""
    window = window_of_interest(trace)
    part = trace.window(window.start, min(window.end, window.start + LONGEST))
    step = sample_step(part.time)
    values = alternating(np.asarray(part[channel], dtype=float), step, window.reason == SETTLED)
    ratio = Fraction(RATE * step).limit_denominator(1000)
    heard = resample_poly(values, ratio.numerator, ratio.denominator)
    fade = min(int(FADE * RATE), heard.size // 2)
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(fade) / max(fade, 1))
    heard[:fade] *= ramp
    heard[heard.size - fade :] *= ramp[::-1]
    peak = float(np.abs(heard).max()) or 1.0
    full_scale = peak / HEADROOM
    samples = np.rint(heard / full_scale * STEPS).astype(np.int16)
    rms = float(np.sqrt(np.mean(values**2)))
    return Sound(channel, trace.channels[channel].unit, samples, full_scale, rms, *map(float, part.time[[0, -1]]))


def heard_channel(trace: Trace) -> str | None:
    """The channel that is heard when nobody chose one: a bearing force, else a mesh force; None without either."""
    names = force_channels(trace)
    return next((name for name in names if ".fy" in name), names[0] if names else None)


def player(sound: Sound, link: str) -> str:
    """An element that plays the sound, from inside the page; link: the file beside it."""
    data = base64.b64encode(sound.wav).decode()
    label = escape(f"Sound of {shown(sound.channel)}", quote=True)
    return (
        f'<figure><audio controls loop aria-label="{label}" src="data:audio/wav;base64,{data}"></audio>'
        f'<figcaption>{escape(sound.caption)}<a href="{link}">{link}</a></figcaption></figure>'
    )

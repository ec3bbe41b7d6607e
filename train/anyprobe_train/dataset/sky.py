"""Daylight by the analytic model of Preetham, Shirley and Smits, "A Practical Analytic Model for
Daylight" (SIGGRAPH 1999), over a ground that the sun and the sky light.

Their sky is kept in shape and colour and scaled to the light that the beam loses on its way: with the
paper's own zenith luminance a clear sky is 2 to 4 times too bright beside its sun (Zotti, Wilkie and
Purgathofer, "A Critical Review of the Preetham Skylight Model", WSCG 2007).

Elevation is the sun's above the horizon [radians]; the paper's theta_s is pi / 2 - elevation.
Radiance is photometric: linear Rec. 709 whose luminance is in kcd/m^2, irradiance likewise in klx.
"""

from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe_train.dataset.catalog import normalize_map


def tint(rng: np.random.Generator, strength: float) -> np.ndarray:
    """Return a random colour [3] of mean 1."""
    color = np.exp(rng.normal(0.0, strength, size=3))
    return color / color.mean()


def direction_at(azimuth: float, elevation: float) -> np.ndarray:
    """Return a unit vector [3]; azimuth 0 is -Z, a quarter turn +X."""
    c = np.cos(elevation)
    return np.array([c * np.sin(azimuth), np.sin(elevation), -c * np.cos(azimuth)])


def lamp_direction(rng: np.random.Generator) -> np.ndarray:
    """Draw a direction [3] that lamps and suns come from: above the horizon or a little below."""
    return direction_at(rng.uniform(0, 2 * np.pi), np.arcsin(rng.uniform(-0.15, 0.98)))


def soft_cap(d: np.ndarray, centre: np.ndarray, radius: float, softness: float = 0.15) -> np.ndarray:
    """Return 1 inside a cap of the given radius [radians], falling off over softness x radius: [..., 1]."""
    angle = np.arccos(np.clip(d @ centre, -1.0, 1.0))
    return np.clip((radius - angle) / (softness * radius) + 0.5, 0.0, 1.0)[..., None]


def even_disc(height: int, centre: np.ndarray, radius: float, softness: float, power: np.ndarray) -> np.ndarray:
    """Return a round source [H, 2H, 3] whose integral is power [3]; centre, radius, softness: of soft_cap."""
    disc = soft_cap(pixel_directions(height).astype(np.float64), centre, radius, softness)
    return disc * power / (disc[..., 0] * pixel_solid_angles(height)).sum()


def soft_box(d: np.ndarray, centre: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """Return 1 inside an upright rectangle a unit away, of half width and height extent [2]: [..., 1]."""
    right = np.cross(centre, [0, 1, 0])
    right /= np.linalg.norm(right)
    top = np.cross(right, centre)
    toward = np.maximum(d @ centre, 1e-6)
    x, y = (d @ right) / toward, (d @ top) / toward
    return ((np.abs(x) < extent[0]) & (np.abs(y) < extent[1]) & (d @ centre > 0))[..., None]


def studio(rng: np.random.Generator, height: int = 256) -> np.ndarray:
    """Draw a dim surround with a few soft boxes and round light sources; mean luminance 1."""
    d = pixel_directions(height).astype(np.float64)
    up = d[..., 1:2] * 0.5 + 0.5
    radiance = rng.uniform(0.02, 0.25) * (tint(rng, 0.1) * (1 - up) + tint(rng, 0.1) * up)
    for _ in range(rng.integers(1, 6)):
        centre = direction_at(rng.uniform(0, 2 * np.pi), rng.uniform(-0.2, 1.45))
        power = np.exp(rng.uniform(np.log(2.0), np.log(60.0))) * tint(rng, 0.15)
        if rng.random() < 0.5:
            radiance = radiance + power * soft_cap(d, centre, rng.uniform(0.06, 0.5))
        else:
            radiance = radiance + power * soft_box(d, centre, rng.uniform(0.1, 0.7, size=2))
    return normalize_map(radiance)


SUN_RADIUS = np.radians(0.267)
TURBIDITY = (2.0, 10.0)
"""Range of turbidity, from clear to hazy; below 1.9 the model's zenith luminance fails for a low sun."""

PEREZ = {  # A2: coefficients A to E of Y, x and y as (slope, intercept) in turbidity
    "Y": [(0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)],
    "x": [(-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)],
    "y": [(-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)],
}
ZENITH = {  # A2: rows T^2, T, 1; columns theta_s^3, theta_s^2, theta_s, 1
    "x": [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ],
    "y": [
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ],
}

WAVELENGTHS = np.arange(380.0, 751.0, 10.0)  # nm
# fmt: off
SUN_RADIANCE = 10.0 * np.array([  # Table 2, W/(cm^2 um sr) to W/(m^2 nm sr)
    1655.9, 1623.37, 2112.75, 2588.82, 2582.91, 2423.23, 2676.05, 2965.83, 3054.54, 3005.75, 3066.37,
    2883.04, 2871.21, 2782.5, 2710.06, 2723.36, 2636.13, 2550.38, 2506.02, 2531.16, 2535.59, 2513.42,
    2463.15, 2417.32, 2368.53, 2321.21, 2282.77, 2233.98, 2197.02, 2152.67, 2109.79, 2072.83, 2024.04,
    1987.08, 1942.72, 1907.24, 1862.89, 1825.92])
OZONE = np.array([  # Table 2, k_o [1/cm]
    0, 0, 0, 0, 0, 0, 0, 0.003, 0.006, 0.009, 0.014, 0.021, 0.03, 0.04, 0.048, 0.063, 0.075, 0.085, 0.103,
    0.12, 0.12, 0.115, 0.125, 0.12, 0.105, 0.09, 0.079, 0.067, 0.057, 0.048, 0.036, 0.028, 0.023, 0.018,
    0.014, 0.011, 0.01, 0.009])
VAPOUR = np.array([0.0] * 31 + [0.016, 0.024, 0.0125, 1.0, 0.87, 0.061, 0.001])  # Table 2, k_wa [1/cm]
# fmt: on

REC709_FROM_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


@dataclass(frozen=True, kw_only=True, slots=True)
class Day:
    """Outdoor light: radiance [H, 2H, 3] without the sun, the sun's disc [H, 2H, 3], and its direction sun [3]; beam
    [3], its irradiance on a plane that faces it; ground [3], irradiance of the level ground."""

    radiance: np.ndarray
    disc: np.ndarray
    sun: np.ndarray
    beam: np.ndarray
    ground: np.ndarray


def matching_functions(wavelength: np.ndarray) -> np.ndarray:
    """Return CIE 1931 x, y, z at wavelengths [nm]: [..., 3], the multi-lobe fit of Wyman et al. (JCGT 2013)."""

    def lobe(centre, below, above):
        return np.exp(-0.5 * ((wavelength - centre) / np.where(wavelength < centre, below, above)) ** 2)

    x = 1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2)
    y = 0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1)
    z = 1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8)
    return np.stack([x, y, z], axis=-1)


def zenith_luminance(elevation: float, turbidity: float) -> float:
    """Return Y_z [kcd/m^2], A2: (4.0453 T - 4.9710) tan(chi) - 0.2155 T + 2.4192.

    chi = (4/9 - T/120) (pi - 2 theta_s).
    """
    chi = (4 / 9 - turbidity / 120) * 2 * elevation
    return (4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192


def sky_radiance(d: np.ndarray, sun: np.ndarray, turbidity: float) -> np.ndarray:
    """Return the clear sky without its sun along d [..., 3]; below the horizon, the value at the horizon.

    Eq. 3 and 4: each of Y, x, y is its zenith value times F(theta, gamma) / F(0, theta_s), with
    Perez's F = (1 + A e^(B / cos theta)) (1 + C e^(D gamma) + E cos^2 gamma).
    """
    theta_s = np.arccos(np.clip(sun[1], 0.0, 1.0))
    cosine = np.maximum(d[..., 1], 1e-3)
    gamma = np.arccos(np.clip(d @ sun, -1.0, 1.0))
    zenith = {
        name: float(np.array([turbidity**2, turbidity, 1.0]) @ rows @ theta_s ** np.arange(3, -1, -1.0))
        for name, rows in ZENITH.items()
    }
    zenith["Y"] = max(zenith_luminance(np.pi / 2 - theta_s, turbidity), 0.0)

    def relative(name):
        a, b, c, fall, e = (slope * turbidity + intercept for slope, intercept in PEREZ[name])

        def perez(cos_theta, angle):
            surroundings = 1 + c * np.exp(fall * angle) + e * np.cos(angle) ** 2
            return (1 + a * np.exp(b / cos_theta)) * surroundings

        return zenith[name] * perez(cosine, gamma) / perez(1.0, theta_s)

    big_y, x, y = relative("Y"), relative("x"), relative("y")
    xyz = np.stack([x / y, np.ones_like(y), (1 - x - y) / y], axis=-1) * big_y[..., None]
    return np.maximum(xyz @ REC709_FROM_XYZ.T, 0.0)


def _through_the_air(elevation: float, turbidity: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the transmittances of A1 at WAVELENGTHS: Rayleigh, aerosol, and all absorbers."""
    theta_deg = 90.0 - np.degrees(elevation)
    m = 1 / (np.sin(elevation) + 0.15 * (93.885 - theta_deg) ** -1.253)  # relative optical mass
    micron = WAVELENGTHS / 1000
    beta = 0.04608 * turbidity - 0.04586  # Angstrom's turbidity coefficient
    rayleigh = np.exp(-0.008735 * micron**-4.08 * m)
    aerosol = np.exp(-beta * micron**-1.3 * m)
    water = 0.2385 * 2.0 * VAPOUR * m / (1 + 20.07 * 2.0 * VAPOUR * m) ** 0.45  # 2 cm of it
    return rayleigh, aerosol, np.exp(-0.35 * OZONE * m - water)  # 0.35 cm of ozone


def sun_irradiance(elevation: float, turbidity: float) -> np.ndarray:
    """Return E [3] of the sun alone on a plane that faces it: A1, Table 2's radiance through the air."""
    rayleigh, aerosol, absorbed = _through_the_air(elevation, turbidity)
    spectrum = SUN_RADIANCE * np.pi * np.sin(SUN_RADIUS) ** 2 * rayleigh * aerosol * absorbed  # [W/(m^2 nm)]
    xyz = 683e-3 * 10.0 * (spectrum[:, None] * matching_functions(WAVELENGTHS)).sum(axis=0)  # 683 lm/W, 10 nm a step
    return np.maximum(REC709_FROM_XYZ @ xyz, 0.0)


def scattered_irradiance(elevation: float, turbidity: float) -> float:
    """Return the luminous E [klx] of the clear sky on the ground, from the beam's loss to scattering.

    Half of Rayleigh's and 0.84 of the aerosol's share comes down (Bird and Hulstrom, SERI/TR-642-761,
    1981). Twilight keeps a sun on the horizon from leaving a black sky.
    """
    rayleigh, aerosol, absorbed = _through_the_air(elevation, turbidity)
    down = (0.5 * (1 - rayleigh) + 0.84 * (1 - aerosol) * rayleigh) * absorbed
    whole = SUN_RADIANCE * np.pi * np.sin(SUN_RADIUS) ** 2 * max(np.sin(elevation), 0.01)
    return 683e-3 * 10.0 * float((whole * down * matching_functions(WAVELENGTHS)[:, 1]).sum())


def clear_sky(d: np.ndarray, sun: np.ndarray, turbidity: float) -> np.ndarray:
    """Return sky_radiance scaled to scattered_irradiance."""
    coarse = pixel_directions(32).astype(np.float64)
    model = np.where(coarse[..., 1:2] > 0, sky_radiance(coarse, sun, turbidity), 0.0)
    elevation = np.arcsin(np.clip(sun[1], 0.0, 1.0))
    scale = scattered_irradiance(elevation, turbidity) / luminance(horizontal_irradiance(model))
    return sky_radiance(d, sun, turbidity) * scale


def sun_disc(height: int, sun: np.ndarray, irradiance: np.ndarray) -> np.ndarray:
    """Return the sun's radiance [H, 2H, 3]: widened to 1.5 rows where it is narrower, of the same power."""
    return even_disc(height, sun, max(SUN_RADIUS, 1.5 * np.pi / height), 0.5, irradiance)


def horizontal_irradiance(radiance: np.ndarray) -> np.ndarray:
    """Return E [3] of a map on a plane that faces +Y."""
    up = np.maximum(pixel_directions(radiance.shape[0])[..., 1], 0.0) * pixel_solid_angles(radiance.shape[0])
    return np.einsum("hwc,hw->c", radiance, up)


def _waves(rng: np.random.Generator, x: np.ndarray, longest: float, shortest: float) -> np.ndarray:
    """Sum two dozen bent sines over x [..., 3], [...]: about 1 at most places, now and then 3."""
    total = np.zeros(x.shape[:-1])
    for _ in range(24):
        k = normalize(rng.normal(size=3)) * np.exp(rng.uniform(np.log(6.28 / longest), np.log(6.28 / shortest)))
        bend = 0.6 * np.sin(x @ rng.normal(size=3) * 12.6 / longest + rng.uniform(0, 6.28))
        total += np.sin(x @ k + bend + rng.uniform(0, 6.28)) * (6.28 / np.linalg.norm(k) / longest) ** 0.8
    return total


def _clouds(rng: np.random.Generator, d: np.ndarray) -> np.ndarray:
    """Draw the cloud cover along d, [..., 1] in [0, 1]: waves of a layer overhead."""
    layer = d / (np.abs(d[..., 1:2]) + 0.25)
    cloud = _waves(rng, layer, 2.5, 0.2) * rng.uniform(0.4, 1.2) + rng.uniform(-1.0, 0.8)
    return np.clip(cloud, 0.0, 1.0)[..., None]


GROUNDS = np.array(
    [
        [0.16, 0.20, 0.08],  # grass
        [0.08, 0.11, 0.05],  # trees
        [0.26, 0.19, 0.13],  # soil
        [0.45, 0.38, 0.28],  # sand
        [0.12, 0.12, 0.125],  # asphalt
        [0.36, 0.35, 0.33],  # concrete, stone
        [0.06, 0.09, 0.11],  # water
        [0.75, 0.78, 0.82],  # snow
    ]
)


def _ground(rng: np.random.Generator, d: np.ndarray, horizon: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Draw the albedo [..., 3] of the ground under a skyline, and where the ground is [..., 1]."""
    plain = d / (np.maximum(-d[..., 1:2], 0.0) + 0.1)
    patches = _waves(rng, plain, 4.0, 0.3)[..., None]
    one, other, far = rng.choice(GROUNDS, 3) * np.exp(rng.normal(0, 0.2, (3, 1)))
    mixed = one + (other - one) * rng.uniform(0.0, 1.0) * np.clip(patches + rng.uniform(-1.0, 1.0), 0.0, 1.0)
    near = mixed * np.clip(1 + rng.uniform(0.0, 0.15) * patches, 0.5, 1.5) * tint(rng, 0.06)
    return np.where(d[..., 1:2] > 0, far * tint(rng, 0.15), near), d[..., 1:2] < horizon


def _skyline(rng: np.random.Generator, d: np.ndarray) -> np.ndarray:
    """Draw the sine of the elevation up to which the ground hides the sky, [..., 1]: flat, hills or houses."""
    azimuth = np.arctan2(d[..., :1], -d[..., 2:])
    waves = sum(np.sin(k * azimuth + rng.uniform(0, 6.28)) / k**0.7 for k in rng.integers(1, 24, size=8))
    waves = waves * rng.uniform(0.0, 0.08)
    if rng.random() < 0.4:
        steps = np.round(azimuth * rng.uniform(3, 9)) * 12.9898 + rng.uniform(0, 99)
        waves = waves + rng.uniform(0.0, 0.35) * (np.sin(steps) * 43758.5453 % 1.0)
    return np.maximum(waves, 0.0)


def draw_day(rng: np.random.Generator, height: int) -> Day:
    """Draw a day with random sun, haze, clouds, skyline and ground."""
    d = pixel_directions(height).astype(np.float64)
    sun = direction_at(rng.uniform(0, 2 * np.pi), np.arcsin(rng.uniform(0.03, 0.98)))
    turbidity = TURBIDITY[0] * (TURBIDITY[1] / TURBIDITY[0]) ** rng.uniform()
    clear = clear_sky(d, sun, turbidity)
    beam = sun_irradiance(np.arcsin(sun[1]), turbidity)
    up = d[..., 1:2] > 0
    cover = np.zeros_like(clear[..., :1])
    kind = rng.choice(["clear", "clear", "clouds", "clouds", "overcast"])
    if kind == "clouds":
        cover = _clouds(rng, d)
    total = luminance(horizontal_irradiance(np.where(up, clear, 0.0)) + beam * sun[1])
    grey = total / np.pi * rng.uniform(0.5, 1.1)
    if kind == "overcast":  # CIE's overcast sky: the zenith three times the horizon
        cover = cover + rng.uniform(0.9, 1.0)
        grey = grey * rng.uniform(0.2, 0.6) * (1 + 2 * np.maximum(d[..., 1:2], 0)) / 2
    thick = np.clip(1.3 - 0.6 * cover, 0.0, 1.0)  # bright edges, dark middles
    forward = np.clip(d @ sun, 0, 1)[..., None] ** 12 * rng.uniform(0.0, 0.4 if kind == "overcast" else 3.0)
    clouds = grey * tint(rng, 0.03) * thick * (1 + forward)
    disc = sun_disc(height, sun, beam)
    weight = (disc.sum(axis=-1) * pixel_solid_angles(height))[..., None]
    transmitted = np.exp(-8.0 * (cover * weight).sum() / weight.sum())  # of the sun's light through the clouds
    above = np.where(up, clear * (1 - cover) + clouds * cover, 0.0)
    light = horizontal_irradiance(above) + beam * sun[1] * transmitted
    albedo, hidden = _ground(rng, d, _skyline(rng, d))
    facing = np.where(up, np.clip(0.6 - 0.5 * (d @ (sun * [1, 0, 1]))[..., None], 0.1, 1.0), 1.0)
    disc = np.where(hidden, 0.0, disc * transmitted)
    return Day(
        radiance=np.where(hidden, albedo * light / np.pi * facing, above),
        disc=disc,
        sun=sun,
        beam=np.einsum("hwc,h->c", disc, pixel_solid_angles(height)[:, 0]),
        ground=light,
    )


def sky(rng: np.random.Generator, height: int = 256) -> np.ndarray:
    """Render a day outdoors; mean luminance 1."""
    day = draw_day(rng, height)
    balance = (luminance(day.ground) / np.maximum(day.ground, 0.2 * luminance(day.ground))) ** rng.uniform()
    return normalize_map((day.radiance + day.disc) * balance)  # the camera's white, set for the ground

"""Renders of recipes, point by point in perspective: a photo with its targets (Pair).

Every visible point is shaded by itself, in NumPy, so that bytes do not depend on a compiler.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_y, world_from_camera
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.response import MEAN_CURVE, response
from anyprobe.core.sampling import hammersley
from anyprobe.errors import InvalidMesh
from anyprobe.light.environment import MAP_HEIGHT, reduced, rotate
from anyprobe.render.integrate import shade
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import Camera, Surface, frame_object, pixel_rays, see
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.camera import Shot, draw_shot, meter, one_photo
from anyprobe_train.dataset.distributions import SPECULAR_BELOW, draw_alpha, draw_material
from anyprobe_train.dataset.mask_errors import disturb_mask
from anyprobe_train.dataset.recipe import VIEWPOINTS, WORLD, Recipe

Trace = Callable[[Recipe, Mesh, Camera, np.ndarray, Material], np.ndarray]
"""Renderer of a photo: from a recipe, its mesh, a camera, the map [H, 2H, 3] in the mesh's world and the material to
linear RGB (and more) [S, S, 3+]."""

NUM_SAMPLES = 64


@dataclass(frozen=True, kw_only=True, slots=True)
class Pair:
    """An object's photo and its light (the paper's Fig. 10).

    photo [S, S, 4] uint8: display RGB, zero outside the mask, and the mask as the user gives it.
    irradiance [S, S, 3] uint8: display values through the mean curve, zero off the object.
    radiance [64, 128, 3]: the map in the camera's frame and the photo's exposure units.
    map_from_camera [3, 3], gain [3]: rotation and factor from the stored map to radiance.
    tan_half: tangent of half the angle that the photo's side takes in.
    normals [S, S, 3]: in the camera's frame, zero off the object; only for methods that are given normals.
    material: the object's, without texture; of two materials, the one that covers more.
    """

    recipe: Recipe
    photo: np.ndarray
    irradiance: np.ndarray
    radiance: np.ndarray
    map_from_camera: np.ndarray
    gain: np.ndarray
    tan_half: float
    normals: np.ndarray
    material: Material
    map_name: str
    shape_name: str
    indoor: bool

    @property
    def specular(self) -> bool:
        """Whether the material is specular by the paper's border, alpha below 0.5."""
        return self.material.alpha < SPECULAR_BELOW

    @property
    def crop(self) -> np.ndarray:
        """Input of the networks, [S, S, 4] float32: display RGB times mask, and mask."""
        return self.photo.astype(np.float32) / 255.0


def fibonacci_viewpoint(index: int) -> tuple[float, float]:
    """Return yaw and elevation [radians] of one of VIEWPOINTS points spread evenly over the upper hemisphere."""
    return float(index * np.pi * (3.0 - np.sqrt(5.0))), float(np.arcsin((index + 0.5) / VIEWPOINTS))


def render_pair(recipe: Recipe, store: AssetStore, trace: Trace | None = None) -> Pair:
    """Render the pair of a recipe; InputError if the store lacks its map or shape, or it is not visible.

    trace: makes the photo in the place of our shading; the irradiance stays what no shadow falls on.
    """
    asset, shape, rng = store.map(recipe.map_id), store.shape(recipe.shape_id), recipe.rng()
    world_from_camera, fov_deg, material, map_yaw, shot = _draw(recipe, rng)
    camera, surface = _look(shape.mesh, world_from_camera, fov_deg, shape.name)
    # the map turns about the shape, so that shape and light are not tied together
    map_from_camera = rotation_y(map_yaw) @ camera.world_from_camera
    turn = map_from_camera.T.astype(np.float32)
    pyramid, u = store.pyramid(recipe.map_id), hammersley(NUM_SAMPLES)
    shading = shade(pyramid, surface.normals @ turn, surface.wo @ turn, float(material.alpha), u)
    normals = np.zeros((*surface.mask.shape, 3), np.float32)
    normals[surface.mask] = surface.normals
    reflected = shading.radiance(material)
    if trace is not None:
        map_from_world = map_from_camera @ camera.world_from_camera.T
        surroundings = rotate(asset.radiance, map_from_world.T)
        reflected = trace(recipe, shape.mesh, camera, surroundings, material)[surface.mask][:, :3]
    light = reduced(rotate(asset.radiance, map_from_camera.T), MAP_HEIGHT)
    picture = np.zeros((*surface.mask.shape, 3), reflected.dtype)
    picture[surface.mask] = reflected
    shot, gain = meter(shot, light, float(luminance(reflected).mean()), recipe.conditions == WORLD, rng)
    background, mask = None, surface.mask
    if recipe.conditions:
        away = -pixel_rays(camera.tan_half, camera.size) @ turn
        background = np.asarray(bilinear(asset.radiance, direction_to_uv(away)) * gain)
        mask = disturb_mask(mask, rng)
    photo = one_photo(shot, picture * gain, surface.mask, background, rng) * mask[..., None]
    irradiance = np.zeros(normals.shape, np.uint8)
    gains = np.asarray(gain * shot.white_balance, np.float32)
    irradiance[surface.mask] = np.round(response(shading.irradiance * gains, MEAN_CURVE) * 255.0)
    return Pair(
        recipe=recipe,
        photo=np.dstack([photo, mask * np.uint8(255)]),
        irradiance=irradiance,
        radiance=np.asarray(light * gains, np.float32),
        map_from_camera=map_from_camera,
        gain=gains,
        tan_half=camera.tan_half,
        normals=normals,
        material=material,
        map_name=asset.name,
        shape_name=shape.name,
        indoor=asset.indoor,
    )


def _draw(recipe: Recipe, rng: np.random.Generator) -> tuple[np.ndarray, float, Material, float, Shot]:
    """Draw all of a recipe but noise and mask errors: world_from_camera, field of view [degrees], material, yaw of the
    map and camera settings; their order decides the recipe's bytes."""
    yaw, elevation = fibonacci_viewpoint(recipe.view)
    turned = world_from_camera(yaw + rng.uniform(0, 2 * np.pi), elevation)
    fov_deg = rng.uniform(10.0, 45.0)
    if recipe.conditions == WORLD:
        kind, brighter = recipe.material % 4, recipe.material // 4
        alpha = float(distributions.draw_alphas(rng, np.array([kind]))[0])
        material = distributions.draw_one(rng, kind, alpha, (brighter + rng.random()) / 2)
    else:
        alpha = draw_alpha(rng, recipe.material % 2 == 0)
        material = draw_material(rng, alpha, bool(recipe.material // 2 % 2))
    map_yaw = rng.uniform(0, 2 * np.pi)
    shot = draw_shot(rng, min(recipe.conditions, 1))
    return turned, fov_deg, material, map_yaw, shot


def shot_of(recipe: Recipe) -> Shot:
    """Return the camera settings of a recipe's photo; under WORLD without metering and white balance."""
    return _draw(recipe, recipe.rng())[-1]


def _look(mesh: Mesh, world_from_camera: np.ndarray, fov_deg: float, name: str) -> tuple[Camera, Surface]:
    """Return the camera of a pair and what it sees of the shape.

    Where that is nothing, as of cards seen edge on, the camera goes round by quarter turns.
    """
    for _ in range(4):
        camera = frame_object(mesh, world_from_camera, fov_deg=fov_deg)
        surface = see(mesh, camera)
        if surface.mask.any():
            return camera, surface
        world_from_camera = rotation_y(np.pi / 2) @ world_from_camera
    raise InvalidMesh(
        f"expected a shape visible in {camera.size} pixels, got one too thin from all sides; leave it out", source=name
    )

"""Trials: short runs that each change one thing of `lift_trial`, so that it can be told what that is worth.

All see 19,200 pairs made in the same way; `anyprobe trials` scores them together (docs/ablation.md).
"""

from __future__ import annotations

from dataclasses import replace

from anyprobe.train.config import LightConfig, RunConfig, lift, normals


def lift_trial() -> RunConfig:
    """What the others are compared with: a short run of `lift`, plain objects, nothing told of what is around."""
    plain = replace(
        lift().pairs, around=0.0, gathered=0.0, joined=0.0, reshaped=0.0, textured=0.0, two_materials=0.0
    )
    return replace(
        lift(),
        name="lift_trial",
        steps=600,
        warmup=50,
        cooldown=0.5,
        pairs=replace(plain, seed=59),
        surfaces=replace(lift().surfaces, views=9, figures=400, parts=0, bend=0.0, relief=0.0, seed=4),
        light=replace(lift().light, seed=8),
    )


def lift_again() -> RunConfig:
    """The same from other first weights, on other pairs: what chance alone does."""
    return replace(lift_trial(), name="lift_again", seed=1, pairs=replace(lift_trial().pairs, seed=60))


# where a pixel's light goes, and what completes the map


def code_trial() -> RunConfig:
    """Without lifting: everything passes through one vector."""
    return _changed("code_trial", lifting=False)


def queries_trial() -> RunConfig:
    """Lifting, and directions that ask the object's pixels (nets.queries)."""
    return _changed("queries_trial", queries=True)


def queries_alone() -> RunConfig:
    """Directions that ask the object's pixels, without lifting."""
    return _changed("queries_alone", queries=True, lifting=False)


# what is learned


def tasks_trial() -> RunConfig:
    """Without the side tasks: neither irradiance nor alpha is asked for, only normals and the map."""
    return _changed("tasks_trial", irradiance=0.0, alpha=0.0)


def pixels_trial() -> RunConfig:
    """Errors of single pixels alone: neither their means over larger ones, nor structure, nor what balls see."""
    return _changed("pixels_trial", scales=0.0, structure=0.0, transport=0.0)


def harmonics_trial() -> RunConfig:
    """With a loss of the map's spherical harmonics of order 0 to 3."""
    return _changed("harmonics_trial", harmonics=0.2)


def anchors_trial() -> RunConfig:
    """With a loss of how far light must be carried to where it is."""
    return _changed("anchors_trial", anchors=0.2)


def still_trial() -> RunConfig:
    """With a loss of what changes from a frame to the next."""
    return _changed("still_trial", stillness=0.3)


def dual_trial() -> RunConfig:
    """Two tone-mapped maps that are merged (nets.tones) in the place of a display's map and lamps."""
    return _changed("dual_trial", tones=1.0, lamps=0.0, flux=0.0)


# which light, which photos


def light_train() -> RunConfig:
    """Real maps of hdri/train alone."""
    return _lit("light_train", LightConfig(extra=False, procedural=0))


def light_real() -> RunConfig:
    """Real maps, those of hdri/train_extra too."""
    return _lit("light_real", LightConfig(procedural=0))


def light_both() -> RunConfig:
    """Real maps and our own; `lift_trial` has light made of these too."""
    return _lit("light_both", LightConfig(procedural=200))


def clean_trial() -> RunConfig:
    """Photos as the paper's: no blur, noise or JPEG, masks exact."""
    return replace(
        lift_trial(), name="clean_trial", pairs=replace(lift_trial().pairs, conditions=0, cut_out=0.0)
    )


def shapes_trial() -> RunConfig:
    """The normals of `lift` alone, from more and other shapes: machined parts, surfaces joined and reshaped."""
    return replace(
        normals(),
        name="shapes_trial",
        steps=2_500,
        pairs=replace(normals().pairs, seed=82, joined=0.3, reshaped=0.7),
        surfaces=replace(normals().surfaces, parts=800),
    )


def _changed(name: str, **losses) -> RunConfig:
    return replace(lift_trial(), name=name, lift=replace(lift_trial().lift, **losses))


def _lit(name: str, light: LightConfig) -> RunConfig:
    return replace(lift_trial(), name=name, light=replace(light, seed=lift_trial().light.seed))


TRIALS = (
    lift_trial,
    lift_again,
    code_trial,
    queries_trial,
    queries_alone,
    tasks_trial,
    pixels_trial,
    harmonics_trial,
    anchors_trial,
    still_trial,
    dual_trial,
    light_train,
    light_real,
    light_both,
    clean_trial,
)
"""What `anyprobe trials` compares, the first with all others; shapes_trial trains another model."""

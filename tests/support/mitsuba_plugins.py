"""What Mitsuba 3 lacks for the judge: the paper's Eq. 2, and direct light that nothing shadows.

Import only after a variant is set (mitsuba_scenes.open_mitsuba does both): Mitsuba's
base classes belong to the variant. Mitsuba calls the eye wi and the light wo.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi


class PaperBSDF(mi.BSDF):
    """(1 - F) albedo / pi + D F G / (4 (n.wi)(n.wo)), F by Schlick at wi.m, GGX.

    D and Smith's G1 are Mitsuba's. `correlated` chooses Heitz's height-correlated
    G = 1 / (1 + Lambda_i + Lambda_o) with Lambda = 1 / G1 - 1, or the product of the G1.
    Samples come from the cosine and from the visible normals, half each, or from the
    normals alone where there is no albedo.
    """

    def __init__(self, props):
        super().__init__(props)
        self.albedo = mi.ScalarColor3f(props["albedo"])
        self.f0 = mi.ScalarColor3f(props["f0"])
        self.alpha = props["alpha"]
        self.correlated = props.get("correlated", True)
        self.cosine_share = 0.5 if max(self.albedo) > 0 else 0.0
        flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
        self.m_components = [flags]
        self.m_flags = flags

    def _normals(self):
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, sample_visible=True)

    def sample(self, ctx, si, sample1, sample2, active=True):
        m, _ = self._normals().sample(si.wi, sample2)
        from_cosine = sample1 < self.cosine_share
        bs = mi.BSDFSample3f()
        bs.wo = dr.select(from_cosine, mi.warp.square_to_cosine_hemisphere(sample2), mi.reflect(si.wi, m))
        bs.eta = 1.0
        bs.sampled_component = 0
        bs.sampled_type = +mi.BSDFFlags.GlossyReflection
        value, bs.pdf = self.eval_pdf(ctx, si, bs.wo, active)
        active = active & (bs.pdf > 0)
        return bs, dr.select(active, value / bs.pdf, 0)

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active=True):
        cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
        active = active & (cos_i > 0) & (cos_o > 0)
        m = dr.normalize(si.wi + wo)
        wi_dot_m = dr.dot(si.wi, m)
        normals = self._normals()
        g1_i, g1_o = normals.smith_g1(si.wi, m), normals.smith_g1(wo, m)
        g = dr.rcp(dr.rcp(g1_i) + dr.rcp(g1_o) - 1) if self.correlated else g1_i * g1_o
        fresnel = self.f0 + (1 - mi.Color3f(self.f0)) * (1 - wi_dot_m) ** 5
        coat = fresnel * normals.eval(m) * g / (4 * cos_i)
        base = (1 - fresnel) * mi.Color3f(self.albedo) * dr.inv_pi * cos_o
        pdf = self.cosine_share * mi.warp.square_to_cosine_hemisphere_pdf(wo)
        pdf += (1 - self.cosine_share) * normals.pdf(si.wi, m) / (4 * wi_dot_m)
        return dr.select(active, coat + base, 0), dr.select(active, pdf, 0)


class UnshadowedDirect(mi.SamplingIntegrator):
    """Light straight from the one environment: BSDF and emitter samples by MIS, no shadow rays."""

    def sample(self, scene, sampler, ray, medium=None, active=True):
        si = scene.ray_intersect(ray, active)
        active = active & si.is_valid()
        bsdf, light, ctx = si.bsdf(ray), scene.environment(), mi.BSDFContext()
        towards, weight = light.sample_direction(si, sampler.next_2d(active), active)
        wo = si.to_local(towards.d)
        value, pdf = bsdf.eval_pdf(ctx, si, wo, active)
        radiance = dr.select(active & (towards.pdf > 0), value * weight * _balance(towards.pdf, pdf), 0)
        bs, value = bsdf.sample(ctx, si, sampler.next_1d(active), sampler.next_2d(active), active)
        active = active & (bs.pdf > 0)
        towards = dr.zeros(mi.DirectionSample3f)
        towards.d = si.to_world(bs.wo)
        pdf = dr.select(mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta), 0, light.pdf_direction(si, towards, active))
        seen = dr.select(active, value * environment_radiance(light, towards.d) * _balance(bs.pdf, pdf), 0)
        return radiance + seen, si.is_valid(), []


class HalfVectorLight(mi.SamplingIntegrator):
    """The samples of Eq. 5: h with density D (n.h), the light at the mirrored eye.

    A sample that leaves below the horizon is black; it is left out of the mean by its alpha.
    """

    def __init__(self, props):
        super().__init__(props)
        self.width = props["alpha"]

    def sample(self, scene, sampler, ray, medium=None, active=True):
        si = scene.ray_intersect(ray, active)
        normals = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.width, sample_visible=False)
        h, _ = normals.sample(si.wi, sampler.next_2d(active))
        wo = mi.reflect(si.wi, h)
        kept = active & si.is_valid() & (mi.Frame3f.cos_theta(wo) > 0) & (dr.dot(si.wi, h) > 0)
        radiance = environment_radiance(scene.environment(), si.to_world(wo))
        return dr.select(kept, radiance, 0), kept, []


def environment_radiance(light, direction):
    """Radiance that arrives from a world direction."""
    seen = dr.zeros(mi.SurfaceInteraction3f, dr.width(direction))
    seen.wi = -direction
    return light.eval(seen)


def _balance(pdf, other):
    """Veach's balance heuristic."""
    return dr.select(pdf > 0, pdf / (pdf + other), 0)


mi.register_bsdf("paper", PaperBSDF)
mi.register_integrator("unshadowed", UnshadowedDirect)
mi.register_integrator("half_vector_light", HalfVectorLight)

"""The paper's Eq. 2 as a BSDF of Mitsuba 3, which has no Lambert base under a Schlick coat of its own.

Mitsuba calls the eye wi and the light wo.
"""

from __future__ import annotations

NAME = "anyprobe_material"


def register(mi) -> None:
    """Make NAME known to the module `mitsuba`; its variant must be set, its base classes belong to it."""
    import drjit as dr

    class MaterialBSDF(mi.BSDF):
        """(1 - F) albedo / pi + D F G / (4 (n.wi)(n.wo)): GGX, Schlick, height-correlated Smith.

        Samples come from the cosine and from the visible normals, half each; from the normals
        alone where there is no albedo.
        """

        def __init__(self, props):
            super().__init__(props)
            self.albedo = props["albedo"]  # a colour, or a texture
            self.textured = isinstance(self.albedo, mi.Texture)
            self.f0 = mi.ScalarColor3f(props["f0"])
            self.alpha = props["alpha"]
            self.cosine_share = 0.5 if self.textured or max(self.albedo) > 0 else 0.0
            kind = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [kind]
            self.m_flags = kind

        def _normals(self):
            return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, sample_visible=True)

        def sample(self, ctx, si, sample1, sample2, active=True):
            h, _ = self._normals().sample(si.wi, sample2)
            by_cosine = sample1 < self.cosine_share
            drawn = mi.BSDFSample3f()
            drawn.wo = dr.select(
                by_cosine, mi.warp.square_to_cosine_hemisphere(sample2), mi.reflect(si.wi, h)
            )
            drawn.eta = 1.0
            drawn.sampled_component = 0
            drawn.sampled_type = +mi.BSDFFlags.GlossyReflection
            value, drawn.pdf = self.eval_pdf(ctx, si, drawn.wo, active)
            return drawn, dr.select(active & (drawn.pdf > 0), value / drawn.pdf, 0)

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx, si, wo, active=True):
            n_dot_wi, n_dot_wo = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            active = active & (n_dot_wi > 0) & (n_dot_wo > 0)
            h = dr.normalize(si.wi + wo)
            wi_dot_h = dr.dot(si.wi, h)
            normals = self._normals()
            g1_wi, g1_wo = normals.smith_g1(si.wi, h), normals.smith_g1(wo, h)
            g = dr.rcp(dr.rcp(g1_wi) + dr.rcp(g1_wo) - 1)
            fresnel = self.f0 + (1 - mi.Color3f(self.f0)) * (1 - wi_dot_h) ** 5
            coat = fresnel * normals.eval(h) * g / (4 * n_dot_wi)
            albedo = self.albedo.eval(si, active) if self.textured else mi.Color3f(self.albedo)
            base = (1 - fresnel) * albedo * dr.inv_pi * n_dot_wo
            pdf = self.cosine_share * mi.warp.square_to_cosine_hemisphere_pdf(wo)
            pdf += (1 - self.cosine_share) * normals.pdf(si.wi, h) / (4 * wi_dot_h)
            return dr.select(active, coat + base, 0), dr.select(active, pdf, 0)

    mi.register_bsdf(NAME, MaterialBSDF)

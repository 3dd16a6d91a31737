# SPDX-License-Identifier: Apache-2.0
"""Random materials. A material is (index in the file, metres that one repeat of its texture spans)."""

import numpy as np

from . import textures
from .textures import linear


class Materials:
    """Makes materials of one scene; textures are shared, since files should stay small."""

    def __init__(self, scene, rng, most_textures=10):
        self.scene, self.rng, self.left = scene, rng, most_textures
        self.colors, self.bumps, self.roughs = [], [], []

    def color(self, **limits):
        return tuple(float(c) for c in linear(textures.color(self.rng, **limits)))

    def _texture(self, image, repeat=True):
        return self.scene.texture(textures.png(image), repeat)

    def color_map(self, kinds=None):
        """A texture of the given kinds, or any; an old one once the file has enough."""
        if self.left <= 0 and self.colors:
            return self.colors[self.rng.integers(len(self.colors))]
        self.left -= 1
        kind = kinds[self.rng.integers(len(kinds))] if kinds else textures.pattern
        image = kind(self.rng)
        self.colors.append(self._texture(image[0] if isinstance(image, tuple) else image))
        return self.colors[-1]

    def bump(self):
        if len(self.bumps) < 2:
            if self.rng.uniform() < 0.5:
                height = textures.fractal(self.rng, 128, int(self.rng.integers(4, 24)), 3)
            else:
                height = textures.bricks(self.rng)[1]
            self.bumps.append(self._texture(textures.normals(height, self.rng.uniform(1, 6))))
        return self.bumps[self.rng.integers(len(self.bumps))]

    def rough_map(self):
        """Roughness in green and metalness in blue: scratches and worn patches."""
        if len(self.roughs) < 1:
            t = textures.fractal(self.rng, 128, int(self.rng.integers(3, 20)), 3)
            low, high = np.sort(self.rng.uniform(0.1, 1.0, 2))
            t = np.clip((t - 0.5) * 3 + 0.5, 0, 1)
            self.roughs.append(self._texture(np.stack([0 * t, low + (high - low) * t, 0 * t + 1], axis=-1)))
        return self.roughs[self.rng.integers(len(self.roughs))]

    def tile(self):
        return float(np.exp(self.rng.uniform(np.log(0.15), np.log(2.5))))

    # ---- families ----

    def matte(self, **limits):
        return self.scene.diffuse("matte", self.color(**limits)), 1.0

    def matte_textured(self, kinds=None):
        options = {"normal_map": self.bump()} if self.rng.uniform() < 0.25 else {}
        return self.scene.diffuse("pattern", (1, 1, 1), color_map=self.color_map(kinds), **options), self.tile()

    def plastic(self, roughness=None, **limits):
        r = self.rng.uniform(0.02, 0.9) if roughness is None else roughness
        if self.rng.uniform() < 0.3:
            return self.scene.material("glossy pattern", (1, 1, 1), roughness=r,
                                       color_map=self.color_map()), self.tile()
        return self.scene.material("plastic", self.color(**limits), roughness=r), 1.0

    def metal(self, roughness=None):
        r = float(self.rng.choice([0.02, 0.1, 0.2, 0.35, 0.5, 0.8])) if roughness is None else roughness
        known = [(0.95, 0.64, 0.54), (1.0, 0.78, 0.34), (0.92, 0.92, 0.93), (0.56, 0.57, 0.58), (0.8, 0.8, 0.82)]
        base = known[self.rng.integers(5)] if self.rng.uniform() < 0.8 else self.color(value=(0.4, 0.95))
        options, k = {}, self.rng.uniform()
        if k < 0.2:
            options["KHR_materials_anisotropy"] = {"anisotropyStrength": float(self.rng.uniform(0.3, 0.9)),
                                                   "anisotropyRotation": float(self.rng.uniform(0, 3.14))}
            r = max(r, 0.2)
        elif k < 0.4:
            options["metal_rough_map"], r = self.rough_map(), 1.0
        elif k < 0.5:
            options["normal_map"] = self.bump()
        return self.scene.material("metal", base, metallic=1.0, roughness=r, **options), self.tile()

    def coated(self):
        coat = {"clearcoatFactor": float(self.rng.uniform(0.4, 1)),
                "clearcoatRoughnessFactor": float(self.rng.uniform(0, 0.25))}
        return self.scene.material("coated", self.color(), metallic=float(self.rng.integers(2)),
                                   roughness=float(self.rng.uniform(0.3, 0.9)), KHR_materials_clearcoat=coat), 1.0

    def cloth(self):
        options, base = {}, (1, 1, 1)
        if self.rng.uniform() < 0.5:
            options["color_map"] = self.color_map([textures.weave, textures.stripes, textures.mottled, textures.dots])
        else:
            base = self.color()
        if self.rng.uniform() < 0.5:
            options["KHR_materials_sheen"] = {"sheenColorFactor": list(self.color(value=(0.2, 0.9))),
                                              "sheenRoughnessFactor": float(self.rng.uniform(0.2, 0.9))}
        return self.scene.material("cloth", base, roughness=float(self.rng.uniform(0.7, 1)), **options), self.tile()

    def wood(self):
        r = self.rng.uniform(0.15, 1.0)
        return self.scene.material("wood", (1, 1, 1), roughness=r,
                                   color_map=self.color_map([textures.wood])), self.tile()

    def film(self):
        return self.scene.material(
            "thin film", self.color(), metallic=float(self.rng.integers(2)),
            roughness=float(self.rng.uniform(0.05, 0.5)), KHR_materials_iridescence={
                "iridescenceFactor": 1.0, "iridescenceThicknessMaximum": float(self.rng.uniform(200, 800))}), 1.0

    def thin(self):
        """Paper, leaves, lamp shades and curtains: lets diffuse light through."""
        tint = [float(c) for c in self.color(value=(0.5, 0.95))]
        return self.scene.material("thin", self.color(value=(0.5, 0.95)), roughness=0.9,
                                   KHR_materials_diffuse_transmission={
                                       "diffuseTransmissionFactor": float(self.rng.uniform(0.2, 0.7)),
                                       "diffuseTransmissionColorFactor": tint}), 1.0

    def glass(self):
        """For closed meshes only."""
        options = {}
        if self.rng.uniform() < 0.4:
            options = {"attenuationDistance": float(self.rng.uniform(0.03, 0.5)),
                       "attenuationColor": list(self.color(value=(0.4, 0.95)))}
        r = 0.0 if self.rng.uniform() < 0.7 else float(self.rng.uniform(0.05, 0.5))
        return self.scene.glass("glass", float(self.rng.uniform(1.3, 1.7)), roughness=r, **options), 1.0

    def sheet(self):
        """With holes: grilles, lace, netting."""
        return self.scene.material("sheet", (1, 1, 1), roughness=float(self.rng.uniform(0.2, 1)),
                                   metallic=float(self.rng.integers(2)), mask=0.5,
                                   color_map=self._texture(textures.holes(self.rng))), self.tile()

    def lustre(self):
        """Dielectrics of other indices of refraction and specular tints: from dull rubber to lacquer."""
        options = {"KHR_materials_ior": {"ior": float(self.rng.uniform(1.1, 2.4))}}
        if self.rng.uniform() < 0.4:
            options["KHR_materials_specular"] = {"specularFactor": float(self.rng.uniform(0.2, 1)),
                                                 "specularColorFactor": list(self.color(value=(0.4, 1)))}
        if self.rng.uniform() < 0.4:
            options["normal_map"] = self.bump()
        return self.scene.material("lustre", self.color(), roughness=float(self.rng.uniform(0.02, 0.7)),
                                   **options), self.tile()

    def worn(self):
        """Metal that shows through paint by a texture, and coats over textures."""
        if self.rng.uniform() < 0.5:
            t = textures.fractal(self.rng, 128, int(self.rng.integers(3, 16)), 4) > self.rng.uniform(0.4, 0.6)
            rough = np.where(t, self.rng.uniform(0.05, 0.5), self.rng.uniform(0.3, 1))
            index = self._texture(np.stack([0 * rough, rough, t * 1.0], axis=-1))
            return self.scene.material("worn", self.color(), metallic=1.0, roughness=1.0,
                                       metal_rough_map=index), self.tile()
        coat = {"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": float(self.rng.uniform(0, 0.2))}
        return self.scene.material("lacquer", (1, 1, 1), roughness=float(self.rng.uniform(0.3, 1)),
                                   color_map=self.color_map(), KHR_materials_clearcoat=coat), self.tile()

    def pane(self):
        tint = (1, 1, 1) if self.rng.uniform() < 0.7 else self.color(value=(0.6, 1))
        return self.scene.material("pane", tint, roughness=0.0,
                                   KHR_materials_transmission={"transmissionFactor": 1.0}), 1.0

    def emitter(self, radiance):
        return self.scene.emitter("emitter", tuple(float(r) for r in radiance)), 1.0

    def any(self, closed=False):
        """Whatever there is; glass only for closed meshes."""
        families = [(self.matte, 22), (self.matte_textured, 22), (self.plastic, 16), (self.metal, 12), (self.coated, 5),
                    (self.cloth, 6), (self.wood, 6), (self.film, 2), (self.thin, 2),
                    (self.lustre, 6), (self.worn, 5)]
        if closed:
            families.append((self.glass, 6))
        weights = np.array([w for _, w in families], float)
        return families[self.rng.choice(len(families), p=weights / weights.sum())][0]()

    def plain(self):
        """What walls and large things are mostly made of; seldom dark, or little light would reach most of a room."""
        k = self.rng.uniform()
        return (self.matte(value=(0.45, 0.97)) if k < 0.45 else self.matte_textured() if k < 0.75 else
                self.wood() if k < 0.87 else self.plastic(float(self.rng.uniform(0.15, 0.8)), value=(0.35, 0.95)))

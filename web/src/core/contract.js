/** The numbers that Python and JavaScript share: src/anyprobe/contract.json, written here by build/contract.js. */

export const CONTRACT = {
  "mask": {
    "inside": 0.5,
    "least_object_px": 24,
    "alpha_cuts_at": 0.5,
    "file": {
      "black": 0.1,
      "white": 0.9
    },
    "hole_share": 0.03,
    "u2netp": {
      "size": 320,
      "mean": [
        0.485,
        0.456,
        0.406
      ],
      "spread": [
        0.229,
        0.224,
        0.225
      ]
    },
    "small": {
      "size": 160,
      "grey": 0.5,
      "box_level": 0.5,
      "click_sigma_px": 4
    },
    "search": {
      "grid": 320,
      "margin": 0.12,
      "windows": [
        0.7,
        0.45,
        0.3,
        0.2
      ],
      "border_touch": 0.05,
      "sure": 0.9,
      "part_share": 0.2,
      "edge_cells": 3,
      "blank": 0.01,
      "neck": 0.1,
      "split": {
        "grid": 160,
        "step": 0.02,
        "click_cells": 3
      }
    },
    "quality": {
      "doubtful": 0.81,
      "refused": 0.05,
      "u2netp": {
        "offset": -4,
        "weights": {
          "expected": 3,
          "agreed": 4,
          "whole": 1,
          "border": 0
        }
      },
      "small": {
        "offset": -4,
        "weights": {
          "expected": 3,
          "agreed": 4,
          "whole": 1,
          "border": 0
        }
      }
    }
  },
  "curve": {
    "exponent": 0.9,
    "sigma": 0.6
  },
  "sizes": {
    "map_height": 64,
    "crop": 128,
    "normals": 64,
    "crop_margin": 1.1
  },
  "lens": {
    "default_long_fov_deg": 65,
    "least_fov_deg": 1,
    "most_fov_deg": 170
  },
  "ground": {
    "usual_pitch_deg": 22,
    "least_slope_deg": 12,
    "least_contact": 0.03,
    "contact_band": 0.04,
    "near": 4,
    "least_pixels": 12,
    "begins_deg": 2,
    "full_deg": 20,
    "weight": 0.85,
    "continued": 0.75,
    "plain_step": 0.012,
    "plain_share": 0.9,
    "samples": 128
  },
  "exposure": {
    "black": 0.02,
    "white": 0.98,
    "enough": 0.5
  },
  "graph": {
    "inputs": [
      "photo",
      "tan_half",
      "given_normals",
      "surroundings",
      "material"
    ],
    "outputs": [
      "irradiance",
      "ln_radiance",
      "confidence",
      "normals",
      "ln_expected",
      "posterior"
    ],
    "chain": [
      "irradiance",
      "illumination",
      "hdr"
    ],
    "emitters": [
      "mode",
      "expected"
    ],
    "ln_most": 11,
    "blend_from": 0.8,
    "shortest_normal": 0.5
  },
  "materials": {
    "least_roughness": 0.1,
    "least_reflectance": 0.02,
    "inputs": 8,
    "named": {
      "chrome": {
        "albedo": [
          0,
          0,
          0
        ],
        "f0": [
          0.549,
          0.556,
          0.554
        ],
        "alpha": 0.03
      },
      "gold": {
        "albedo": [
          0,
          0,
          0
        ],
        "f0": [
          1,
          0.77,
          0.34
        ],
        "alpha": 0.12
      },
      "plastic": {
        "albedo": [
          0.52,
          0.06,
          0.05
        ],
        "f0": [
          0.045,
          0.045,
          0.045
        ],
        "alpha": 0.12
      },
      "matte": {
        "albedo": [
          0.6,
          0.6,
          0.6
        ],
        "f0": [
          0.04,
          0.04,
          0.04
        ],
        "alpha": 0.9
      }
    }
  },
  "filter": {
    "offset": 0.01,
    "still_s": 3,
    "moving_s": 0.02,
    "fast_s": 0.035,
    "noise_s": 1,
    "least_noise": 0.01,
    "cut_level": 1.2,
    "calm": 2,
    "moved": 4.5,
    "let_go": 0.5,
    "forgotten": 0.05,
    "source": {
      "gate_deg": 30,
      "gate_ratio": 8,
      "angle_scale": 2,
      "most_turn_deg_s": 120,
      "patience_s": 0.1,
      "fade_s": 0.25,
      "most": 6
    }
  },
  "source_split": {
    "most": 4,
    "reach_deg": 10,
    "ring_deg": 15,
    "apart_deg": 13,
    "least_share": 0.02,
    "least_radius_deg": 4,
    "most_radius_deg": 7.5
  },
  "dominant_light": {
    "blur_deg": 5,
    "lobe_level": 0.5,
    "ring_px": 3
  },
  "surroundings": {
    "grow_px": 4,
    "fine": 2,
    "clipped": 0.97,
    "seen": 0.9,
    "tint": 0.5,
    "tint_floor": 0.05,
    "plain": 0.00784313725490196
  }
};

/** The numbers that Python and JavaScript share: src/anyprobe/contract.json, written here by build/contract.js. */

export const CONTRACT = {
  "mask": {
    "inside": 0.5,
    "least_object_px": 24,
    "given": {"full": 0.85, "mostly": 0.5, "grey": [0.1, 0.9], "grey_share": 0.5, "few_px": 48, "alpha_most": 0.9},
    "alpha_cuts_at": 0.5,
    "file": { "black": 0.1, "white": 0.9 },
    "hole_share": 0.03,
    "u2netp": { "size": 320, "mean": [0.485, 0.456, 0.406], "spread": [0.229, 0.224, 0.225] },
    "small": { "size": 160, "grey": 0.5, "box_level": 0.5, "click_sigma_px": 4 },
    "search": {
      "grid": 320,
      "margin": 0.12,
      "windows": [0.7, 0.45, 0.3, 0.2],
      "border_touch": 0.05,
      "sure": 0.9,
      "part_share": 0.2,
      "edge_cells": 3,
      "blank": 0.01,
      "neck": 0.1,
      "split": { "grid": 160, "step": 0.02, "click_cells": 3 }
    },
    "quality": {
      "doubtful": 0.81,
      "fits": { "box_iou": 0.6, "click_reach": 2.5, "unasked": 0.9 },
      "refused": 0.05,
      "u2netp": { "offset": -6.64, "weights": { "expected": 2.55, "agreed": 1.5, "whole": 0, "single": 2.79, "meant": 2.96 } },
      "small": { "offset": -12.11, "weights": { "expected": 8.75, "agreed": 0.42, "whole": 4.95, "single": 0, "meant": 0 } }
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
    "crop_margin": 1.1,
    "context": 96,
    "context_scale": 2,
    "context_fine": 4
  },
  "normals": {
    "near_unit": 0.15,
    "unit_share": 0.6,
    "facing": 0.6
  },
  "lens": {
    "default_long_fov_deg": 65.0,
    "least_fov_deg": 1.0,
    "most_fov_deg": 170.0
  },
  "ground": {
    "usual_pitch_deg": 22.0,
    "usual_error_deg": 13.0,
    "given_error_deg": 1.0,
    "unsure_deg": 15.0,
    "least_slope_deg": 12.0,
    "least_contact": 0.03,
    "contact_band": 0.04,
    "plain_step": 0.012,
    "backdrop_level": 0.1,
    "plain_share": 0.9,
    "dark_beside": 0.35,
    "samples": 128
  },
  "exposure": {
    "black": 0.02,
    "white": 0.98,
    "enough": 0.5,
    "doubt": { "dark": 0.05, "dark_share": 0.8, "clipped": 0.99, "clipped_share": 0.2, "samples": 4096 }
  },
  "graph": {
    "inputs": ["photo", "tan_half", "given_normals", "surroundings", "material"],
    "outputs": ["irradiance", "ln_radiance", "confidence", "normals", "ln_expected", "posterior"],
    "whole": {
      "inputs": [
        "context", "tan_half", "alone_expected", "alone_radiance", "alone_confidence", "posterior", "surroundings", "up"
      ],
      "outputs": ["ln_radiance", "ln_expected", "confidence", "posture"]
    },
    "chain": ["irradiance", "illumination", "hdr"],
    "emitters": ["mode", "expected"],
    "ln_most": 11.0,
    "blend_from": 0.8,
    "shortest_normal": 0.5
  },
  "materials": {
    "least_roughness": 0.1,
    "least_reflectance": 0.02,
    "inputs": 8,
    "named": {
      "chrome": { "albedo": [0.0, 0.0, 0.0], "f0": [0.549, 0.556, 0.554], "alpha": 0.03 },
      "gold": { "albedo": [0.0, 0.0, 0.0], "f0": [1.0, 0.77, 0.34], "alpha": 0.12 },
      "plastic": { "albedo": [0.52, 0.06, 0.05], "f0": [0.045, 0.045, 0.045], "alpha": 0.12 },
      "matte": { "albedo": [0.6, 0.6, 0.6], "f0": [0.04, 0.04, 0.04], "alpha": 0.9 },
      "mirror": { "albedo": [0.0, 0.0, 0.0], "f0": [1.0, 1.0, 1.0], "alpha": 0.01 },
      "satin": { "albedo": [0.0, 0.0, 0.0], "f0": [0.9, 0.9, 0.9], "alpha": 0.3 },
      "plaster": { "albedo": [0.8, 0.79, 0.76], "f0": [0.04, 0.04, 0.04], "alpha": 0.9 },
      "marble": { "albedo": [0.75, 0.73, 0.7], "f0": [0.04, 0.04, 0.04], "alpha": 0.09 },
      "clay": { "albedo": [0.36, 0.23, 0.16], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "wood": { "albedo": [0.38, 0.22, 0.11], "f0": [0.04, 0.04, 0.04], "alpha": 0.36 },
      "paper": { "albedo": [0.8, 0.8, 0.78], "f0": [0.04, 0.04, 0.04], "alpha": 0.8 },
      "rubber": { "albedo": [0.04, 0.04, 0.04], "f0": [0.043, 0.043, 0.043], "alpha": 0.5 }
    },
    "measured": {
      "aluminum": { "albedo": [0, 0, 0], "f0": [0.916, 0.923, 0.924], "alpha": 0.01 },
      "aluminum-anodized-red": { "albedo": [0, 0, 0], "f0": [0.6, 0.0, 0.0], "alpha": 0.09 },
      "asphalt-fresh": { "albedo": [0.0429, 0.0414, 0.0401], "f0": [0.0533, 0.0533, 0.0533], "alpha": 0.25 },
      "banana": { "albedo": [0.634, 0.532, 0.111], "f0": [0.04, 0.04, 0.04], "alpha": 0.25 },
      "beryllium": { "albedo": [0, 0, 0], "f0": [0.539, 0.533, 0.534], "alpha": 0.01 },
      "blackboard": { "albedo": [0.039, 0.039, 0.039], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "bone": { "albedo": [0.793, 0.793, 0.664], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "brass": { "albedo": [0, 0, 0], "f0": [0.91, 0.778, 0.423], "alpha": 0.01 },
      "brick": { "albedo": [0.262, 0.095, 0.061], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "car-paint": { "albedo": [0.1, 0.1, 0.1], "f0": [0.04, 0.04, 0.04], "alpha": 0.01 },
      "cardboard": { "albedo": [0.351, 0.208, 0.11], "f0": [0.04, 0.04, 0.04], "alpha": 0.25 },
      "carrot": { "albedo": [0.713, 0.17, 0.026], "f0": [0.04, 0.04, 0.04], "alpha": 0.25 },
      "cesium": { "albedo": [0, 0, 0], "f0": [0.718, 0.554, 0.237], "alpha": 0.01 },
      "charcoal": { "albedo": [0.02, 0.02, 0.02], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "cobalt": { "albedo": [0, 0, 0], "f0": [0.699, 0.704, 0.671], "alpha": 0.01 },
      "concrete": { "albedo": [0.51, 0.51, 0.51], "f0": [0.04, 0.04, 0.04], "alpha": 0.25 },
      "copper": { "albedo": [0, 0, 0], "f0": [0.932, 0.623, 0.522], "alpha": 0.01 },
      "egg-shell-brown": { "albedo": [0.493, 0.248, 0.123], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "egg-shell-white": { "albedo": [0.61, 0.624, 0.631], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "germanium": { "albedo": [0, 0, 0], "f0": [0.5, 0.517, 0.465], "alpha": 0.01 },
      "grass": { "albedo": [0.105, 0.133, 0.041], "f0": [0.04, 0.04, 0.04], "alpha": 0.25 },
      "gray-card": { "albedo": [0.18, 0.18, 0.18], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "iridium": { "albedo": [0, 0, 0], "f0": [0.745, 0.734, 0.704], "alpha": 0.01 },
      "iron": { "albedo": [0, 0, 0], "f0": [0.53, 0.513, 0.494], "alpha": 0.01 },
      "lead": { "albedo": [0, 0, 0], "f0": [0.626, 0.64, 0.693], "alpha": 0.01 },
      "lemon": { "albedo": [0.617, 0.366, 0.045], "f0": [0.04, 0.04, 0.04], "alpha": 0.25 },
      "lithium": { "albedo": [0, 0, 0], "f0": [0.916, 0.89, 0.807], "alpha": 0.01 },
      "magnesium": { "albedo": [0, 0, 0], "f0": [0.956, 0.953, 0.95], "alpha": 0.01 },
      "manganese": { "albedo": [0, 0, 0], "f0": [0.606, 0.592, 0.573], "alpha": 0.01 },
      "mercury": { "albedo": [0, 0, 0], "f0": [0.781, 0.78, 0.778], "alpha": 0.01 },
      "mit-black": { "albedo": [0.0001, 0.0001, 0.0001], "f0": [0.04, 0.04, 0.04], "alpha": 0.9801 },
      "molybdenum": { "albedo": [0, 0, 0], "f0": [0.589, 0.612, 0.594], "alpha": 0.01 },
      "musou-black": { "albedo": [0.006, 0.006, 0.006], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "nickel": { "albedo": [0, 0, 0], "f0": [0.697, 0.641, 0.563], "alpha": 0.01 },
      "office-paper": { "albedo": [0.794, 0.834, 0.884], "f0": [0.04, 0.04, 0.04], "alpha": 0.64 },
      "orange": { "albedo": [0.615, 0.205, 0.01], "f0": [0.04, 0.04, 0.04], "alpha": 0.25 },
      "palladium": { "albedo": [0, 0, 0], "f0": [0.734, 0.7036, 0.662], "alpha": 0.01 },
      "platinum": { "albedo": [0, 0, 0], "f0": [0.765, 0.73, 0.676], "alpha": 0.01 },
      "polystyrene-foam": { "albedo": [0.8393, 0.8384, 0.841], "f0": [0.0533, 0.0533, 0.0533], "alpha": 0.25 },
      "porcelain": { "albedo": [0.745, 0.745, 0.723], "f0": [0.04, 0.04, 0.04], "alpha": 0.01 },
      "potassium": { "albedo": [0, 0, 0], "f0": [0.983, 0.956, 0.906], "alpha": 0.01 },
      "rubidium": { "albedo": [0, 0, 0], "f0": [0.919, 0.859, 0.747], "alpha": 0.01 },
      "sand": { "albedo": [0.44, 0.386, 0.2307], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "silicon": { "albedo": [0, 0, 0], "f0": [0.345, 0.369, 0.426], "alpha": 0.01 },
      "silver": { "albedo": [0, 0, 0], "f0": [0.991, 0.985, 0.974], "alpha": 0.01 },
      "sodium": { "albedo": [0, 0, 0], "f0": [0.977, 0.962, 0.936], "alpha": 0.01 },
      "spectralon": { "albedo": [0.99, 0.99, 0.99], "f0": [0.0222, 0.0222, 0.0222], "alpha": 0.9801 },
      "stainless-steel": { "albedo": [0, 0, 0], "f0": [0.669, 0.639, 0.598], "alpha": 0.01 },
      "terracotta": { "albedo": [0.555, 0.212, 0.11], "f0": [0.04, 0.04, 0.04], "alpha": 0.64 },
      "tire": { "albedo": [0.023, 0.023, 0.023], "f0": [0.04, 0.04, 0.04], "alpha": 0.49 },
      "titanium": { "albedo": [0, 0, 0], "f0": [0.441, 0.4, 0.361], "alpha": 0.01 },
      "toilet-paper": { "albedo": [0.83, 0.835, 0.784], "f0": [0.04, 0.04, 0.04], "alpha": 0.81 },
      "toner-black": { "albedo": [0.05, 0.05, 0.05], "f0": [0.04, 0.04, 0.04], "alpha": 0.25 },
      "toothpaste": { "albedo": [0.9325, 0.9369, 0.9286], "f0": [0.04, 0.04, 0.04], "alpha": 0.01 },
      "tungsten": { "albedo": [0, 0, 0], "f0": [0.537, 0.536, 0.519], "alpha": 0.01 },
      "vanadium": { "albedo": [0, 0, 0], "f0": [0.534, 0.526, 0.546], "alpha": 0.01 },
      "whiteboard": { "albedo": [0.869, 0.867, 0.771], "f0": [0.04, 0.04, 0.04], "alpha": 0.01 },
      "zinc": { "albedo": [0, 0, 0], "f0": [0.808, 0.844, 0.865], "alpha": 0.01 }
    }
  },
  "filter": {
    "offset": 0.01,
    "still_s": 3.0,
    "moving_s": 0.02,
    "fast_s": 0.035,
    "noise_s": 1.0,
    "least_noise": 0.01,
    "cut_level": 1.2,
    "calm": 2.0,
    "moved": 4.5,
    "let_go": 0.5,
    "forgotten": 0.05,
    "source": {
      "gate_deg": 30.0,
      "gate_ratio": 8.0,
      "slack_deg": 2.0,
      "most_turn_deg_s": 75.0,
      "patience_s": 0.1,
      "fade_s": 0.25,
      "lead_ratio": 1.75,
      "lead_margin": 1.25,
      "same": { "after_s": 0.7, "odd_s": [0.25, 5.0], "most_turn_deg_s": 40.0 },
      "most": 6,
      "view": {
        "turn_deg": 8.0,
        "recent_s": 0.3,
        "slack_deg": 10.0,
        "slack_ratio": 1.35,
        "most_turn_deg_s": 2.0
      }
    }
  },
  "source_split": {
    "most": 4,
    "reach_deg": 10.0,
    "ring_deg": 15.0,
    "apart_deg": 13.0,
    "least_share": 0.02,
    "least_radius_deg": 4.0,
    "most_radius_deg": 7.5,
    "wide": { "reach_deg": 20.0, "ring_deg": 27.0, "apart_deg": 24.0, "most_radius_deg": 16.0 }
  },
  "registration": {
    "fine_px": 384,
    "coarse_px": 32,
    "points": 3000,
    "reach": 0.25,
    "pull": 0.05,
    "steps": 8,
    "done_px": 0.02,
    "spread": 2.4,
    "least": 0.5,
    "least_gain": 0.2,
    "alike": 0.8,
    "inside": 0.7,
    "agreed": 0.35,
    "error": 3.0
  },
  "held_mask": {
    "every": 8,
    "every_refused": 8,
    "patience": 6,
    "agrees": 0.8,
    "most": 8,
    "most_change": 1.4,
    "faded": 0.9,
    "remembered": 8,
    "other_light": { "times": 2.0, "more": 0.01 },
    "narrow": 0.005,
    "narrow_error": 1.0,
    "narrow_most": 4.0,
    "room": 0.25
  },
  "dominant_light": {
    "blur_deg": 5.0,
    "lobe_level": 0.5,
    "ring_px": 3,
    "error": {
      "power": 1.5,
      "factor": 6.11,
      "offset_deg": 10.0,
      "exponent": 0.55,
      "most_deg": 90.0
    }
  },
  "surroundings": {
    "grow_px": 4,
    "fine": 2.0,
    "clipped": 0.97,
    "seen": 0.9,
    "tint": 0.5,
    "tint_floor": 0.05,
    "plain": 0.00784313725490196,
    "goes_on": {"rows": 32, "least_cover": 0.5, "share": 0.5, "reach_deg": 60}
  }
};

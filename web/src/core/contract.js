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
    "hole_share": 0.03
  }
};

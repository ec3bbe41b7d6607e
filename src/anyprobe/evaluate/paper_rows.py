"""What the paper reports, for the rows beside ours."""

from __future__ import annotations

TABLE1 = {
    "direct": {
        "ldr_psnr": 13.9374, "ldr_rmse": 0.2117, "ldr_ssim": 0.3740,
        "hdr_psnr": 25.5962, "hdr_rmse": 0.0577, "hdr_ssim": 0.3701,
    },
    "irradiance": {
        "irradiance_psnr": 26.9803, "irradiance_rmse": 0.0449, "irradiance_ssim": 0.9502,
        "ldr_psnr": 16.4243, "ldr_rmse": 0.1588, "ldr_ssim": 0.4459,
        "hdr_psnr": 29.5844, "hdr_rmse": 0.0409, "hdr_ssim": 0.4284,
    },
    "ours": {
        "irradiance_psnr": 26.9803, "irradiance_rmse": 0.0449, "irradiance_ssim": 0.9502,
        "ldr_psnr": 17.8786, "ldr_rmse": 0.1271, "ldr_ssim": 0.5298,
        "hdr_psnr": 34.8689, "hdr_rmse": 0.0181, "hdr_ssim": 0.5594,
    },
    "ideal": {
        "irradiance_psnr": 26.9803, "irradiance_rmse": 0.0449, "irradiance_ssim": 0.9502,
        "ldr_psnr": 18.8466, "ldr_rmse": 0.1148, "ldr_ssim": 0.5745,
        "hdr_psnr": 36.1276, "hdr_rmse": 0.0156, "hdr_ssim": 0.9383,
    },
}  # fmt: skip
"""Table 1 of Park et al. 2020: their maps, shapes and HDR normalisation, so only the order compares."""

SECONDS = {
    "i7-6700K": {"irradiance": 0.02437, "illumination": 0.01968, "hdr": 0.01281},
    "GTX 1080 Ti": {"irradiance": 0.00968, "illumination": 0.00812, "hdr": 0.00344},
}
"""Sect. 5, mean time of each network."""

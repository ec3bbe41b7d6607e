"""Three targets for an irradiance network, compared."""

"""Every figure that is published for lighting estimates, of models and baselines on the same test pairs."""

"""The experiments of Ji et al. (2021) redone, with the paper's rivals."""

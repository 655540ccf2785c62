"""Constants of numerical rules: Gauss nodes, tableaux, economised polynomials."""

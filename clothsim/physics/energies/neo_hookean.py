"""Compressible Neo-Hookean sheet: the energy density and its derivatives in principal stretches.

    psi(F) = mu/2 (I1 - 2 - 2 ln J) + lam/2 (ln J)^2,    I1 = tr F'F,  J = sqrt(det F'F),  F (3x2)
    psi_i  = mu s_i + b / s_i,                           b = lam ln J - mu

(docs/results/validation.md, A1; eigen-system of the Hessian in F: Smith, de Goes, Kim 2019, "Analytic eigensystems
for isotropic distortion energies", for 3x2 F.) mu, lam [N/m] per reference area; s1, s2 the stretches.
"""

import numpy as np

from clothsim.base.jit import inlined

TWIST, FLIP, OUT_1, OUT_2 = 0, 1, 2, 3


@inlined
def density(mu, lam, e11, e12, e22, J):
    """psi [J/m2] from E = C - 1 and J; +inf where the triangle has no area.

    I1 - 2 = tr E and 2 ln J = ln(1 + tr E + det E): from the same E, so that near rest, where both nearly cancel, the
    round-off of E is not amplified. Taken from F:F and J, psi would have an error of mu eps, far above its own value.
    """
    if not J > 0.0:
        return np.inf
    if max(abs(e11), abs(e12), abs(e22)) < 0.5:
        log_J = 0.5 * np.log1p(e11 + e22 + (e11 * e22 - e12 * e12))
    else:
        log_J = np.log(J)
    return 0.5 * mu * (e11 + e22 - 2.0 * log_J) + 0.5 * lam * log_J * log_J


@inlined
def inverse_factor(mu, lam, J):
    """b = lam ln J - mu in the stress P = mu F + b F C^-1 [N/m]."""
    return lam * np.log(J) - mu


@inlined
def stretch_block(mu, lam, s1, s2):
    """psi_11, psi_12, psi_22 [N/m]: the Hessian over the two stretch modes w_i v_i'."""
    b = lam * np.log(s1 * s2) - mu
    return mu + (lam - b) / (s1 * s1), lam / (s1 * s2), mu + (lam - b) / (s2 * s2)


@inlined
def other_modes(mu, lam, s1, s2):
    """The eigenvalues of twist, flip and the two out-of-plane modes [N/m], free of cancellation.

    twist (psi1 + psi2)/(s1 + s2) = mu + b/(s1 s2);  flip (psi1 - psi2)/(s1 - s2) = mu - b/(s1 s2), also where s1 = s2;
    out of plane psi_i/s_i = mu + b/s_i^2: negative in compression, these are the wrinkling modes.
    """
    b = lam * np.log(s1 * s2) - mu
    return mu + b / (s1 * s2), mu - b / (s1 * s2), mu + b / (s1 * s1), mu + b / (s2 * s2)

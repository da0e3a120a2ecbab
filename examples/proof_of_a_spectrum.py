"""A spectrum's proof: residuals, orthogonality, and a count by inertia that no mode is missing.

K - s M has as many negative pivots as there are eigenvalues below s, whoever computed them.
"""

import carillon as ca
import matplotlib.pyplot as plt

solution = ca.solve("builtin:pitcher", "two-region", resolution=24, modes=60)
proof = ca.audit(solution)
print(f"{proof.counted} eigenvalues below {proof.counted_below:.4g}, {proof.expected} expected")
print(f"orthogonal to {proof.orthogonality:.1e};", *(proof.faults or ["nothing is wrong"]))

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
left.semilogy(range(1, 61), proof.energy_residuals, "o", ms=3, label="in energy")
left.semilogy(range(1, 61), solution.residuals, "o", ms=3, label="2-norm")
left.set(xlabel="mode", ylabel="residual")
left.legend()
right.step(solution.eigenvalues, range(1, 61), where="post")
right.plot(proof.counted_below, proof.counted, "r*", ms=12, label="counted")
right.set(xlabel="eigenvalue [rad²/s²]", ylabel="modes below")
right.legend()
figure.savefig("proof_of_a_spectrum.png", dpi=80)

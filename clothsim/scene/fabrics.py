"""Named fabrics, each with its source."""

from clothsim.mesh.fabric import Fabric

FABRICS = {
    "cotton": Fabric(
        name="cotton",
        density=0.150,
        thickness=0.318e-3,
        youngs_modulus=0.821e6,
        poisson_ratio=0.243,
        bending_stiffness=5e-6,
        source=(
            "Density, thickness, Young's modulus and Poisson's ratio: Penava, Simic Penava and Knezic, Determination "
            "of the elastic constants of plain woven fabrics by a tensile test in various directions, Fibres & "
            "Textiles in Eastern Europe 22(2), 2014, tables 1 and 3 (their cotton, as C-IPC uses it). Bending "
            "stiffness: not in that paper; typical of light plain cotton in KES tests, .05 gf cm2/cm = 4.9e-6 N m."
        ),
    ),
}

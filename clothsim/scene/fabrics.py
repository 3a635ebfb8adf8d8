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
            "Density, thickness, Young's modulus and Poisson's ratio: the cotton that Penava, Simic Penava and Knezic "
            "measured (Determination of the elastic constants of plain woven fabrics by a tensile test in various "
            "directions, Fibres & Textiles in Eastern Europe 22(2), 2014), as C-IPC uses it (Li, Kaufman, Jiang 2021, "
            "table 1). Bending stiffness: the middle of the 2e-6 to 1e-5 N m that KES bending tests of light plain "
            "cotton give (0.02 to 0.1 gf cm2/cm, 1 gf cm2/cm = 9.80665e-5 N m)."
        ),
    ),
}

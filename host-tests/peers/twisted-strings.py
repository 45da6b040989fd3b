"""Writes host-tests/reference/twisted-strings.csv: the rigid twisted-string actuator by an independent package.

    python3 -m venv venv && venv/bin/pip install twisted-strings==0.0.2
    venv/bin/python host-tests/peers/twisted-strings.py > host-tests/reference/twisted-strings.csv

The package knows two strings of fixed length L and fixed radius r that meet at both ends: no rods, no offset, no
stretch. Columns: L, r, motor angle, contraction since no twist, its derivative by the angle, and the torque that
holds 1 N.
"""

from twisted_strings import Data, Model
from twisted_strings.dynamics import static
from twisted_strings.kinematics import contraction, jacobian

# The length of the paper's strings and a long one; radii of thin and thick ones.
ACTUATORS = [(0.097, 0.0006), (0.097, 0.00025), (0.2, 0.001), (1.0, 0.0007)]
# θ r/L. From 0.84 on, 46 % of contraction, two strings of that radius lie closed up side by side.
SHARES = [0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75, 0.8]


def main():
    print("length_m,radius_m,angle_rad,contraction_m,jacobian_m_per_rad,torque_nm_per_n")
    for length, radius in ACTUATORS:
        model = Model()
        model.kinematic.length, model.kinematic.radius = length, radius
        for share in SHARES:
            data = Data()
            angle = round(share * length / radius, 3)
            row = [contraction(model, data, angle), jacobian(model, data, theta=angle), static(model, data, 1.0)]
            print(",".join(repr(float(value)) for value in [length, radius, angle, *row]))


if __name__ == "__main__":
    main()

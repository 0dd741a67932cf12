//! Masses of the homogeneous bodies from which MuJoCo infers the inertia of a body.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

use super::chain::Mass;

/// A homogeneous body, centred in its frame, with its axis along z. Lengths in m.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// With the radius.
    Sphere(f64),
    /// A cylinder with a hemisphere at each end: radius and half the length between the hemispheres.
    Capsule(f64, f64),
    /// Radius and half its length.
    Cylinder(f64, f64),
    /// With its semi-axes.
    Ellipsoid([f64; 3]),
    /// With half its sides.
    Box([f64; 3]),
}

impl Shape {
    /// Returns the volume, m³.
    pub fn volume_m3(self) -> f64 {
        let ball = |[a, b, c]: [f64; 3]| 4.0 / 3.0 * PI * a * b * c;
        match self {
            Self::Sphere(radius) => ball([radius; 3]),
            Self::Capsule(radius, half) => 2.0 * PI * radius * radius * half + ball([radius; 3]),
            Self::Cylinder(radius, half) => 2.0 * PI * radius * radius * half,
            Self::Ellipsoid(axes) => ball(axes),
            Self::Box([a, b, c]) => 8.0 * a * b * c,
        }
    }

    /// Returns this shape with a mass of `kg`.
    pub fn mass(self, kg: f64) -> Mass {
        // The moments of each shape are those of its squares: Ixx = m (y² + z²) with the mean squares of the coordinates.
        let mean_squares =
            |share: f64, [a, b, c]: [f64; 3]| share * Vector3::new(a * a, b * b, c * c);
        let mean = match self {
            Self::Sphere(radius) => mean_squares(1.0 / 5.0, [radius; 3]),
            Self::Ellipsoid(axes) => mean_squares(1.0 / 5.0, axes),
            Self::Box(sides) => mean_squares(1.0 / 3.0, sides),
            Self::Cylinder(radius, half) => cylinder(radius, half),
            Self::Capsule(radius, half) => {
                let round = Self::Sphere(radius).volume_m3() / self.volume_m3();
                let mut ends = mean_squares(1.0 / 5.0, [radius; 3]);
                // Hemispheres, whose centres of mass are 3/8 of the radius beyond the cylinder.
                ends.z += half * half + 0.75 * radius * half;
                round * ends + (1.0 - round) * cylinder(radius, half)
            }
        };
        let moments = Vector3::repeat(mean.sum()) - mean;
        Mass {
            kg,
            centre: Vector3::zeros(),
            inertia: kg * Matrix3::from_diagonal(&moments),
        }
    }
}

/// Returns the mean squares of the coordinates in a cylinder, m².
fn cylinder(radius: f64, half: f64) -> Vector3<f64> {
    let across = radius * radius / 4.0;
    Vector3::new(across, across, half * half / 3.0)
}

//! Stable neo-Hookean tissue: energy density, stress and the derivative of the stress.

use glam::{DMat3, DVec3};

/// Lamé's two moduli of stable neo-Hookean tissue.
///
/// ψ = μ/2 (|F|² − 3) + l/2 (J − 1 − μ/l)², with J = det F and l = λ + μ; here less its value at
/// rest, so that ψ(1) = 0: ψ = μ/2 (|F|² − 3) − μ (J − 1) + l/2 (J − 1)². For small strains it is
/// the linear body of E and ν.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Shear modulus μ [Pa].
    pub mu_pa: f64,
    /// First modulus λ [Pa].
    pub lambda_pa: f64,
}

impl Material {
    /// Tissue of Young's modulus E [Pa] and Poisson's ratio ν below 1/2.
    pub fn new(youngs_modulus_pa: f64, poisson_ratio: f64) -> Self {
        let (e, nu) = (youngs_modulus_pa, poisson_ratio);
        Self {
            mu_pa: e / (2.0 * (1.0 + nu)),
            lambda_pa: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
        }
    }

    /// Energy density ψ at the deformation gradient `f` [J/m³].
    pub fn density(self, f: DMat3) -> f64 {
        let Self { mu_pa, lambda_pa } = self;
        let dilation = f.determinant() - 1.0;
        let norm_squared =
            f.x_axis.length_squared() + f.y_axis.length_squared() + f.z_axis.length_squared();
        mu_pa * (0.5 * (norm_squared - 3.0) - dilation)
            + 0.5 * (lambda_pa + mu_pa) * dilation * dilation
    }

    /// ∂ψ/∂J at fixed |F|, (λ+μ)(J − 1) − μ [Pa].
    pub fn pressure(self, j: f64) -> f64 {
        (self.lambda_pa + self.mu_pa) * (j - 1.0) - self.mu_pa
    }

    /// First Piola–Kirchhoff stress P = ∂ψ/∂F = μF + ∂ψ/∂J cof F [Pa].
    pub fn stress(self, f: DMat3) -> DMat3 {
        self.mu_pa * f + self.pressure(f.determinant()) * cofactor(f)
    }

    /// gₐᵢ (∂P/∂F) g_bⱼ: what a force through the shape gradient `ga` of one corner resists to a
    /// motion through `gb` of another [Pa/m²].
    ///
    /// With ∂J/∂F = cof F and ∂(cof F)/∂F given by ε_ikm ε_jln F_mn, that is
    /// μ (ga·gb) 1 + l (cof F ga)(cof F gb)ᵀ − ∂ψ/∂J [F (ga × gb)]×.
    pub fn stiffness(self, f: DMat3, ga: DVec3, gb: DVec3) -> DMat3 {
        let cofactor = cofactor(f);
        let (na, nb) = (cofactor * ga, cofactor * gb);
        let w = self.pressure(f.determinant()) * (f * ga.cross(gb));
        let turn = DMat3::from_cols(
            DVec3::new(0.0, -w.z, w.y),
            DVec3::new(w.z, 0.0, -w.x),
            DVec3::new(-w.y, w.x, 0.0),
        );
        let l = self.lambda_pa + self.mu_pa;
        DMat3::from_diagonal(DVec3::splat(self.mu_pa * ga.dot(gb)))
            + DMat3::from_cols(l * nb.x * na, l * nb.y * na, l * nb.z * na)
            + turn
    }
}

/// Cofactor matrix: `det F · F⁻ᵀ`, also where F has no inverse.
fn cofactor(f: DMat3) -> DMat3 {
    DMat3::from_cols(
        f.y_axis.cross(f.z_axis),
        f.z_axis.cross(f.x_axis),
        f.x_axis.cross(f.y_axis),
    )
}

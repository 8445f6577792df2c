//! A deformation is chosen, the body force that makes it follows from the equations, and the reference must find
//! the deformation again, better by the square of the cells' size.

use super::*;

const SIDE_M: f64 = 0.1;
const TISSUE: Tissue = Tissue {
    youngs_modulus_pa: 1e4,
    poisson_ratio: 0.4,
};

/// The chosen place of the point that is at `x` at rest [m].
fn chosen(x: DVec3) -> DVec3 {
    let s = 3.0 / SIDE_M * x;
    let u = DVec3::new(
        0.12 * s.y.sin() + 0.10 * s.x.cos(),
        0.15 * (s.x * s.z / 3.0).sin(),
        0.10 * (s.x + s.y).cos() - 0.08 * s.z.sin(),
    );
    x + SIDE_M / 3.0 * u
}

/// Derivative of a field along each axis, by central differences of fourth order: 1e-11 of it wrong.
fn derivatives<T>(x: DVec3, field: impl Fn(DVec3) -> T) -> [T; 3]
where
    T: std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let step = 2e-3 * SIDE_M;
    DVec3::AXES.map(|axis| {
        let near = field(x + step * axis) - field(x - step * axis);
        let far = field(x + 2.0 * step * axis) - field(x - 2.0 * step * axis);
        (near * 8.0 - far) * (1.0 / (12.0 * step))
    })
}

fn stress_pa(material: Material, x: DVec3) -> DMat3 {
    let [a, b, c] = derivatives(x, chosen);
    material.stress(DMat3::from_cols(a, b, c))
}

/// The body force in equilibrium with the chosen deformation, −Div P [N/m³].
fn body_force_n_m3(material: Material, x: DVec3) -> DVec3 {
    let [a, b, c] = derivatives(x, |x| stress_pa(material, x));
    -(a.x_axis + b.y_axis + c.z_axis)
}

/// Barycentric coordinates and weights of four points that integrate second order exactly.
fn quadrature() -> [[f64; 4]; 4] {
    let (near, far) = (0.25 + 0.15 * 5.0_f64.sqrt(), 0.25 - 0.05 * 5.0_f64.sqrt());
    std::array::from_fn(|point| std::array::from_fn(|k| if k == point { near } else { far }))
}

/// Root mean square distance from the chosen deformation over its size, on a cube of so many irregular cells a
/// side; solved with so many times the modulus that the body force was made for.
fn rms_error(cells: usize, modulus_factor: f64) -> f64 {
    let size_m = Vec3::splat(SIDE_M as f32);
    let skin = |x: Vec3| x.min_element() < 1e-6 || (size_m - x).min_element() < 1e-6;
    let mut setup = block(size_m, [cells; 3], skin);
    shake_inside(&mut setup, size_m, 0.15 * size_m.x / cells as f32);
    let rest = rest_of(&setup);
    let exact: Vec<DVec3> = rest.iter().map(|x| chosen(*x)).collect();
    let mut fem = fem(&setup, TISSUE.stiffer(modulus_factor).material());
    hold(&mut fem, &setup, &exact);
    let corners = |places: &[DVec3], tet: [u32; 4]| tet.map(|i| places[i as usize]);
    let at = |corners: [DVec3; 4], weights: [f64; 4]| -> DVec3 {
        corners.into_iter().zip(weights).map(|(x, w)| w * x).sum()
    };
    let volume_m3 = |tet: [u32; 4]| palpate::geom::tet::volume_m3(corners(&rest, tet));
    for &tet in &setup.tets.tets {
        for weights in quadrature() {
            let x = at(corners(&rest, tet), weights);
            let force = 0.25 * volume_m3(tet) * body_force_n_m3(TISSUE.material(), x);
            for (corner, weight) in tet.into_iter().zip(weights) {
                fem.push(corner as usize, weight * force);
            }
        }
    }
    let found = fem.statics().expect("it settles").positions;
    let (mut wrong, mut moved) = (0.0, 0.0);
    for &tet in &setup.tets.tets {
        for weights in quadrature() {
            let x = at(corners(&rest, tet), weights);
            let y = at(corners(&found, tet), weights);
            wrong += volume_m3(tet) * y.distance_squared(chosen(x));
            moved += volume_m3(tet) * x.distance_squared(chosen(x));
        }
    }
    f64::sqrt(wrong / moved)
}

#[test]
fn manufactured_solution_is_found_with_second_order() {
    let errors = [3, 6, 12].map(|cells| rms_error(cells, 1.0));
    let orders: Vec<f64> = (errors.windows(2))
        .map(|pair| (pair[0] / pair[1]).log2())
        .collect();
    println!("manufactured, Reference: {errors:.5?} on 3, 6, 12 cells, orders {orders:.2?}");
    // Second order for linear elements in the mean square.
    assert!(orders[1] > 1.8, "{orders:?}");
    assert!(errors[2] < 0.01, "{errors:?}");
}

#[test]
fn order_check_notices_a_modulus_five_per_cent_off() {
    let errors = [6, 12].map(|cells| rms_error(cells, 1.05));
    let order = (errors[0] / errors[1]).log2();
    println!("manufactured, 5 % too stiff: {errors:.5?} on 6, 12 cells, order {order:.2}");
    assert!(order < 1.8, "{order}");
}

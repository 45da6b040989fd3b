//! The rod against numbers that others computed by other means (crates/tsa-model/README.md section 2).

use tsa_model::rod::{Rod, TipForce};

/// Tip of a rod so slender that it does not stretch: x/L, w/L, φ at V and H in units of EI/L².
fn elastica(v: f64, h: f64) -> (f64, f64, f64) {
    // (R/L)² is what stretch amounts to: 1e-14.
    let (length, radius) = (1.0, 1e-7);
    let rod = Rod::new(length, radius, &[1e20, 0.0, 0.0, 0.0, 0.0]);
    let unit = rod.bending_stiffness_nm2() / (length * length);
    let force = TipForce { inward_n: h * unit, sideways_n: v * unit };
    let (response, ..) = rod.respond(force).unwrap();
    (response.reach.value / length, response.deflection.value / length, response.tip_angle_rad)
}

#[test]
fn the_exact_end_load_table() {
    // Elliptic integrals, 30 digits: α, w/L, u/L, φ.
    for (alpha, w, u, phi) in [
        (0.2, 0.06636448214, 0.002646548341, 0.09963616304),
        (0.25, 0.08274591535, 0.00411781841, 0.1242924421),
        (0.4, 0.1309752421, 0.01035392155, 0.1971546237),
        (0.5, 0.1621435757, 0.01591896247, 0.2445336471),
        (0.6, 0.1923502797, 0.02248766798, 0.2907377668),
        (0.75, 0.2356152314, 0.03396631503, 0.3575261669),
        (0.8, 0.249451542, 0.03816561324, 0.3790630076),
        (1.0, 0.3017207738, 0.05643323628, 0.4613519497),
        (1.5, 0.4109782112, 0.1079415007, 0.6395398262),
        (2.0, 0.4934574804, 0.1606417208, 0.7817498316),
        (3.0, 0.6032534411, 0.2544201846, 0.9860169467),
        (4.0, 0.6699641813, 0.3289412422, 1.121239347),
        (5.0, 0.7137915236, 0.3876283607, 1.215368118),
        (6.0, 0.7445711489, 0.4345888287, 1.283697286),
        (7.0, 0.7673690997, 0.4729274284, 1.334959857),
        (8.0, 0.784982375, 0.5048277321, 1.374431507),
        (9.0, 0.7990555275, 0.5318205627, 1.405465334),
        (10.0, 0.8106090249, 0.5549955978, 1.430285539),
        (15.0, 0.8477156743, 0.6352857804, 1.501840154),
        (20.0, 0.8686958983, 0.6838855676, 1.532934956),
        (50.0, 0.9171554473, 0.800000396, 1.567981902),
    ] {
        let (x, deflection, angle) = elastica(alpha, 0.0);
        assert!((deflection - w).abs() < 1e-10, "α = {alpha}: w/L = {deflection}");
        assert!((1.0 - x - u).abs() < 1e-10, "α = {alpha}: u/L = {}", 1.0 - x);
        assert!((angle - phi).abs() < 1e-9, "α = {alpha}: φ = {angle}");
    }
}

#[test]
fn inclined_end_loads() {
    for (v, h, x, w) in [
        (1.46, 1.46, 0.7455337412730, 0.5967975189399),
        (10.0, 6.0, 0.0762649878973, 0.8595834568967),
        (10.0, 0.0, 0.4450044022462, 0.8106090248803),
    ] {
        let (reach, deflection, _) = elastica(v, h);
        assert!((reach - x).abs() < 1e-9 && (deflection - w).abs() < 1e-9, "({v}, {h}): {reach}, {deflection}");
    }
}

#[test]
fn the_full_polynomial_rod() {
    // l = 13 mm, R = 0.5 mm, a1…a5 = 20 000 MPa each; two independent solvers agree on these to 6e-12 mm.
    let rod = Rod::new(0.013, 0.0005, &[2e10; 5]);
    for (v, degrees, u_mm, w_mm, phi, strain) in [
        (0.5, 20.0f64, -0.0067276311, 0.3773792753, 0.0435745005, 0.0033),
        (0.5, 40.0, -0.0071502803, 0.3837262141, 0.0443386532, 0.0034),
        (2.5, 20.0, -0.1765952195, 1.9427787450, 0.2258085497, 0.0172),
        (2.5, 40.0, -0.2113850879, 2.1174080450, 0.2472180817, 0.0185),
        (5.0, 20.0, -0.7124425624, 3.8567105296, 0.4559244202, 0.0348),
        (5.0, 40.0, -0.9933830156, 4.5111610124, 0.5415249914, 0.0402),
        (8.5, 20.0, -1.8589382044, 6.0618504340, 0.7420782804, 0.0577),
        (8.5, 40.0, -2.8755355492, 7.3178352633, 0.9357892729, 0.0704),
    ] {
        let alpha = degrees.to_radians();
        let force = TipForce { inward_n: v * alpha.tan(), sideways_n: v };
        let (response, ..) = rod.respond(force).unwrap();
        let u = 1e3 * (response.reach.value - 0.013);
        let w = 1e3 * response.deflection.value;
        let angle = response.tip_angle_rad;
        assert!((u - u_mm).abs() < 1e-9 && (w - w_mm).abs() < 1e-9, "{v} N, {degrees}°: u {u} mm, w {w} mm");
        assert!((angle - phi).abs() < 1e-9, "{v} N, {degrees}°: φ {angle}");
        let bending = response.clamp.bending_squared.sqrt();
        // Printed to four digits, and up to one unit of the last one lower than here.
        assert!((bending - strain).abs() < 1.5e-4, "{v} N, {degrees}°: strain {bending}");
    }
}

/// The section at the clamp carries the force on the tip, and its moment about the clamp.
#[test]
fn the_clamp_balances_force_and_moment_of_the_tip() {
    for law in [[2e10, 0.0, 0.0, 0.0, 0.0], [2e10; 5], [2.4e10, 0.0, -6e12, 0.0, 1e15]] {
        let rod = Rod::new(0.013, 0.0005, &law);
        for (inward_n, sideways_n) in [(0.0, 2.0), (1.5, 2.0), (5.0, 3.0)] {
            let (response, ..) = rod.respond(TipForce { inward_n, sideways_n }).unwrap();
            let force_n = rod.stiffness_n * rod.section.axial_force(response.clamp);
            let moment_nm = rod.stiffness_n * rod.radius_m * rod.section.moment(response.clamp);
            let expected_nm = sideways_n * response.reach.value + inward_n * response.deflection.value;
            assert!((force_n + inward_n).abs() < 1e-8, "{law:?}: {force_n} N for {inward_n} N");
            assert!((moment_nm / expected_nm - 1.0).abs() < 1e-9, "{law:?}: {moment_nm} N m for {expected_nm} N m");
        }
    }
}

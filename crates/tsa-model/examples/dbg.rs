use tsa_model::*;
fn main() {
    let mut seed = 1u64;
    let want: u32 = std::env::args().nth(1).unwrap().parse().unwrap();
    let mut rnd = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut r = |a: f64, b: f64| a + (b - a) * rnd();
    let base = Scene::load("scenes/default.toml").unwrap();
    for i in 0..=want {
        let mut s = base.clone();
        let l0 = r(0.02, 0.5);
        s.geometry.string_length_m = l0;
        s.geometry.rod_span_m = r(0.05, 0.95) * l0;
        s.geometry.clamp_width_m = r(0.0, 1.0) * s.geometry.rod_span_m;
        s.geometry.rod_radius_m = r(0.0001, 0.003);
        s.string.diameter_m = r(0.0002, 0.004);
        s.string.stiffness_n_per_m = 10f64.powf(r(1.0, 5.0));
        s.string.k1_per_n = r(0.5, 20.0);
        s.string.k2 = r(0.0, 0.6);
        s.string.k3 = r(0.0, 0.4);
        if r(0.0, 1.0) < 0.5 {
            s.string.twist_exponent = Some(r(0.0, 1.0));
        } else {
            s.string.radius_law = RadiusLaw::LengthRatio;
            s.string.twist_exponent = None;
        }
        let e = 10f64.powf(r(9.0, 11.5));
        let kind = r(0.0, 4.0) as u32;
        s.material.stress_coefficients_pa = match kind {
            0 => [e, 0.0, 0.0, 0.0, 0.0],
            1 => [e, 0.0, -e * r(0.0, 800.0), 0.0, e * r(0.0, 1e5)],
            2 => [e, e * r(-10.0, 10.0), e * r(-300.0, 300.0), e * r(-3e3, 3e3), e * r(-1e4, 1e5)],
            _ => [e; 5],
        };
        let (load, twist) = (r(0.05, 60.0), r(-90.0, 90.0));
        if i == want {
            println!("{:?} {load} {twist}", s.material.stress_coefficients_pa.map(|a| a / e));
            let at: f64 = std::env::args().nth(2).unwrap().parse().unwrap();
            for k in -10..=10 {
                let t = at * (1.0 + 0.02 * f64::from(k));
                for points in [0usize, 12, 24, 48, 96] {
                    let m = if points == 0 {
                        s.mechanism().unwrap()
                    } else {
                        Mechanism::with_points(&s.geometry, &s.string, &s.material, points).unwrap()
                    };
                    match m.formal(load, t) {
                        Ok(a) => print!("{:.12} {:.4} it{} | ", a.gap_m, a.bending_strain, a.iterations),
                        Err(e) => print!("{e:.30} | "),
                    }
                }
                println!("{t}");
            }
        }
    }
}

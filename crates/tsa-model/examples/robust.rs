use std::collections::BTreeMap;
use tsa_model::*;
fn main() {
    let mut seed = 1u64;
    let mut rnd = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut r = |a: f64, b: f64| a + (b - a) * rnd();
    let base = Scene::load("scenes/default.toml").unwrap();
    let mut kinds: BTreeMap<String, u32> = BTreeMap::new();
    let n: u32 = std::env::args().nth(1).unwrap().parse().unwrap();
    for i in 0..n {
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
        let m = s.mechanism().unwrap();
        let a = m.solve(load, twist);
        let b = m.solve_by(Method::Continuation { steps: 8 }, load, twist);
        let key = match (&a, &b) {
            (Ok(a), Ok(b)) => {
                if (a.gap_m - b.gap_m).abs() < 1e-9 {
                    "same".into()
                } else {
                    format!("DIFFERENT k{kind}")
                }
            }
            (Ok(a), Err(e)) => format!("ok/{} k{kind} nu{}", e.kind(), a.warnings.contains(Warnings::NOT_UNIQUE)),
            (Err(e), Ok(_)) => format!("{}/ok k{kind}", e.kind()),
            (Err(e), Err(f)) => format!("{}/{}", e.kind(), f.kind()),
        };
        let c = kinds.entry(key.clone()).or_insert(0);
        *c += 1;
        if *c <= 2
            && !key.starts_with("same")
            && (key.contains("ok") || key.contains("DIFF") || key.contains("not-conv"))
        {
            println!(
                "{i} {key}: {load} {twist} {:?} {:?} {:?} {:?}",
                s.geometry,
                s.string,
                s.material.stress_coefficients_pa.map(|a| a / e),
                s.material.stress_coefficients_pa[0]
            );
            if let Ok(a) = &a {
                println!(
                    "   a: alpha {} gap {} w {} phi {} strain {} it {} {:?}",
                    a.alpha_rad, a.gap_m, a.w_m, a.tip_angle_rad, a.bending_strain, a.iterations, a.warnings
                )
            } else {
                println!("   {a:?}")
            }
            if let Ok(a) = &b {
                println!(
                    "   b: alpha {} gap {} w {} phi {} strain {} it {}",
                    a.alpha_rad, a.gap_m, a.w_m, a.tip_angle_rad, a.bending_strain, a.iterations
                )
            } else {
                println!("   {b:?}")
            }
        }
    }
    println!("{kinds:#?}");
}

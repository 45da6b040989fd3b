use tsa_model::*;
fn main() {
    for name in ["default", "niti-plateau", "paper-printed"] {
        let m = Scene::load(format!("scenes/{name}.toml")).unwrap().mechanism().unwrap();
        for method in Method::ALL {
            let mut worst = [0.0f64; 3];
            let mut fails = std::collections::BTreeMap::new();
            let (mut ev, mut it, mut n) = (0u64, 0u64, 0u64);
            let t = std::time::Instant::now();
            for load in [0.6, 1.0, 2.0, 5.0, 10.0, 17.0] {
                for twist in [-20.0, -1.0, 0.5, 3.0, 4.0, 12.0, 30.0, 50.0] {
                    let a = m.solve(load, twist);
                    let b = m.solve_by(*method, load, twist);
                    n += 1;
                    match (a, b) {
                        (Ok(a), Ok(b)) => {
                            worst[0] = worst[0].max((a.gap_m - b.gap_m).abs());
                            worst[1] = worst[1].max((a.dgap_dtwist_m_per_rad / b.dgap_dtwist_m_per_rad - 1.0).abs());
                            worst[2] = worst[2].max((a.dgap_dload_m_per_n / b.dgap_dload_m_per_n - 1.0).abs());
                            ev += b.evaluations as u64;
                            it += b.iterations as u64;
                        }
                        (_, Err(e)) => *fails.entry(format!("{e:.60}")).or_insert(0) += 1,
                        _ => {}
                    }
                }
            }
            println!(
                "{name} {:18} gap {:.1e} dθ {:.1e} dF {:.1e} ev {} it {} {:.1} us fails {fails:?}",
                method.name(),
                worst[0],
                worst[1],
                worst[2],
                ev / n,
                it / n,
                t.elapsed().as_secs_f64() * 1e6 / n as f64
            );
        }
    }
}

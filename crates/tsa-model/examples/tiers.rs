use tsa_model::*;
fn main() {
    for name in ["default", "niti-plateau", "paper-printed"] {
        let m = Scene::load(format!("scenes/{name}.toml")).unwrap().mechanism().unwrap();
        for tier in Tier::ALL {
            let t = std::time::Instant::now();
            let mut n = 0;
            print!("{name:12} {:12}", tier.name());
            let mut worst = 0.0f64;
            let mut worst_tr = 0.0f64;
            for load in [1.0, 2.0, 5.0, 10.0, 17.0] {
                for turns in [0.5, 2.0, 4.0, 7.5] {
                    let twist = twist_from_turns(turns);
                    let full = m.solve_tier(Tier::Full, load, twist).unwrap();
                    match m.solve_tier(tier, load, twist) {
                        Ok(a) => {
                            let err = (a.contraction_m() - full.contraction_m()).abs();
                            let tr = (a.equilibrium.tr_rad_per_m() / full.equilibrium.tr_rad_per_m() - 1.0).abs();
                            worst = worst.max(err / a.error.contraction_m);
                            worst_tr = worst_tr.max(tr / a.error.tr_relative);
                            if turns == 7.5 {
                                print!(
                                    "  {load}: {:.1}/{:.1}um {:.2}/{:.2}%",
                                    err * 1e6,
                                    a.error.contraction_m * 1e6,
                                    tr * 100.0,
                                    a.error.tr_relative * 100.0
                                );
                            }
                        }
                        Err(e) => {
                            if turns == 7.5 {
                                print!("  {load}: {e}")
                            }
                        }
                    }
                    n += 1;
                }
            }
            println!("  worst true/est {worst:.2} {worst_tr:.2}");
            let _ = (t, n);
        }
        for tier in Tier::ALL {
            let t = std::time::Instant::now();
            for _ in 0..2000 {
                std::hint::black_box(m.solve_tier(tier, 5.0, 30.0).unwrap());
            }
            println!("{} {:.2} us for two + estimate", tier.name(), t.elapsed().as_secs_f64() / 2000.0 * 1e6);
        }
    }
}

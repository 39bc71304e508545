use verification::symmetry::{Devices, TRANSFORMATIONS, compare, draw};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    for t in TRANSFORMATIONS.iter().filter(|t| t.name().starts_with(&args[1])) {
        for seed in args[2..].iter() {
            let (pair, name) = draw(seed.parse().unwrap(), *t, Devices::Off);
            println!("{seed} {name}");
            for (i, s) in pair.scenes.iter().enumerate() {
                std::fs::write(format!("/tmp/t/sym_{seed}_{i}.json"), serde_json::to_string_pretty(&s.json()).unwrap())
                    .unwrap();
            }
            match compare(&pair) {
                Ok(all) => {
                    for d in all {
                        println!(
                            "   {:24} {:.3e} bound {:.3e}  used {:.3e}",
                            d.quantity,
                            d.difference,
                            d.bound,
                            d.used()
                        );
                    }
                }
                Err(e) => println!("{e:?}"),
            }
        }
    }
}

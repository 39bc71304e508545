//! The direct solver: the results that it must not change, and the builds that have it.

#[cfg(not(feature = "direct"))]
#[test]
fn a_program_without_it_says_so() {
    use bfree::scene;
    use bfree::solver::Preconditioning;

    let direct = r#"solver.krylov.preconditioner="direct""#.parse().unwrap();
    let refused = scene::read_file("scenes/elastica.json".as_ref(), &[direct]).unwrap_err().to_string();
    assert!(refused.contains("solver.krylov.preconditioner") && refused.contains("--features direct"), "{refused}");
    let mut simulation =
        scene::read_file("scenes/elastica.json".as_ref(), &[]).unwrap().build::<2>("scenes".as_ref()).unwrap();
    simulation.settings.preconditioner = Preconditioning::Direct;
    let (chosen, why) = simulation.preconditioner();
    assert!(chosen == Preconditioning::BlockJacobi && why.contains("`direct`"), "{why}");
}

#[cfg(feature = "direct")]
mod built {
    use crate::multigrid::{block, families, iterations, same};
    use crate::support::Failure;
    use bfree::material::{Lame, Material};
    use bfree::mechanics::check::direction;
    use bfree::mechanics::sweep::Supports;
    use bfree::plan::Plan;
    use bfree::scene;
    use bfree::simulation::Simulation;
    use bfree::solver::{Direct, Preconditioner, Preconditioning};
    use bfree::tensor::Vector;
    use num_dual::Dual64;
    use serde_json::{Value, json};

    #[test]
    fn it_changes_no_result_and_leaves_few_iterations() -> Result<(), Failure> {
        fn compare<const D: usize>(cells: u32, more: &Value) -> Result<(), Failure> {
            for (family, inertia) in families().iter().flat_map(|family| [(family, "none"), (family, "newmark")]) {
                let scene = || block::<D>(family, cells, inertia, more.clone());
                let (_, one) = iterations(scene()?, Preconditioning::BlockJacobi)?;
                let (left, other) = iterations(scene()?, Preconditioning::Direct)?;
                assert!(same(&one, &other) && left < 12.0, "{D}D, {family}, {inertia}: {left}");
            }
            Ok(())
        }
        compare::<1>(50, &json!({}))?;
        compare::<2>(8, &json!({}))?;
        compare::<2>(
            6,
            &json!({
                "pressures": [{"body": "block", "region": {"half_space": {"point": [0, 0.99], "normal": [0, -1]}}, "pressure": 20}],
                "solver": {"krylov": {"method": {"gmres": {}}, "forcing": {"fixed": 1e-8}}}
            }),
        )?;
        compare::<3>(3, &json!({}))
    }

    /// ‖K M⁻¹ r − r‖ / ‖r‖ at a deformed state, K by dual numbers through the residual.
    fn left<const D: usize>(simulation: &Simulation<D>) -> Result<f64, Failure> {
        let (supports, nodes) =
            Supports::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
        let (nodal, prescribed) = (simulation.project(&supports)?, simulation.prescribed(&nodes));
        let equilibrium =
            simulation.equilibrium(&supports, &nodal, &prescribed, simulation.settings.scheme.end(0.2), 0.2);
        let size = 0.01 * simulation.grid.spacing;
        let mut dphi: Vec<_> = direction::<D>(nodes.len(), 1).iter().map(|x| x * size).collect();
        let mut r = direction::<D>(nodes.len(), 2);
        for dof in &prescribed {
            (dphi[dof.node][dof.component], r[dof.node][dof.component]) = (0.0, 0.0);
        }
        let (tangent, mut direct, mut z) =
            (equilibrium.tangent(&dphi)?, Direct::<D>::default(), vec![Vector::zeros(); r.len()]);
        direct.prepare(&tangent).apply(bytemuck::cast_slice(&r), bytemuck::cast_slice_mut(&mut z));
        assert!(direct.bytes().is_some(), "not positive definite");
        let seeded: Vec<_> = dphi.iter().zip(&z).map(|(x, d)| x.zip_map(d, Dual64::new)).collect();
        let mut back: Vec<Vector<f64, D>> = equilibrium.residual(&seeded)?.iter().map(|r| r.map(|x| x.eps)).collect();
        equilibrium.clear_prescribed(&mut back);
        let apart: f64 = back.iter().zip(&r).map(|(a, b)| (a - b).norm_squared()).sum();
        Ok((apart / r.iter().map(|r| r.norm_squared()).sum::<f64>()).sqrt())
    }

    #[test]
    fn its_matrix_is_the_derivative_of_the_residual() -> Result<(), Failure> {
        fn judge<const D: usize>(cells: u32) -> Result<(), Failure> {
            for (family, inertia) in families().iter().flat_map(|family| [(family, "none"), (family, "newmark")]) {
                let simulation = block::<D>(family, cells, inertia, json!({}))?;
                for (name, law) in Material::examples(Lame::from_young_poisson(1000.0, 0.3)?) {
                    let left = left(&simulation.clone().with_laws(|_| law.clone()))?;
                    assert!(left < 1e-10, "{D}D, {family}, {inertia}, {name}: {left:e}");
                }
            }
            Ok(())
        }
        judge::<1>(50)?;
        judge::<2>(8)?;
        judge::<3>(3)
    }

    #[test]
    fn it_is_chosen_for_few_particles_in_the_plane_without_inertia() -> Result<(), Failure> {
        let plan = |name: &str| -> Result<_, Failure> {
            let scene = scene::read_file(format!("scenes/{name}.json").as_ref(), &[])?;
            Ok(Plan::of(&scene.build::<2>("scenes".as_ref())?)?)
        };
        let (statics, dynamics) = (plan("elastica")?, plan("rebound")?);
        assert_eq!(statics.preconditioner, (Preconditioning::Direct, "few particles, and inertia does not dominate"));
        assert!(statics.to_string().contains("assembled tangent and its factor"));
        assert_eq!(dynamics.preconditioner.0, Preconditioning::BlockJacobi);
        Ok(())
    }
}

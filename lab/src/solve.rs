//! `solve` by other methods than the tool's own.

use baseline_methods::Method;
use rigctl::commands::solve::{self, How, Solve, Way};
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::output::Output;
use tsa_model::{Mechanism, Tier};

/// Runs the command.
///
/// # Errors
/// If the options contradict each other; as [`solve::answer`].
pub fn run(global: &Global, Solve { at, how }: &Solve, output: &mut Output) -> Result<(), Failure> {
    let scene = global.scene()?;
    let method = chosen(how)?;
    if how.tier != Tier::Full.name() {
        if method != Method::ALL[0] {
            let only = "--tier: only the method first-integral, with its own steps, knows other tiers";
            return Err(Failure::Usage(only.into()));
        }
        return solve::answer(at, &scene, Way::new(how, &scene)?, output);
    }
    let by = |mechanism: &Mechanism, load_n, twist_rad| method.solve(mechanism, load_n, twist_rad);
    solve::answer(at, &scene, Way::By(method.name(), &by), output)
}

/// The method with its effort.
fn chosen(how: &How) -> Result<Method, Failure> {
    // The command line has checked the name.
    let unknown = || Failure::Usage(format!("method {} is unknown", how.method));
    let mut method = Method::named(&how.method).ok_or_else(unknown)?;
    let no = |option: &str| Failure::Usage(format!("--{option}: the method {} has none", how.method));
    if let Some(steps) = how.steps {
        // At most a million: the command line has checked it.
        method = method.with_steps(steps as usize).ok_or_else(|| no("steps"))?;
    }
    if let Some(tolerance) = how.tolerance {
        method = method.with_tolerance(tolerance).ok_or_else(|| no("tolerance"))?;
    }
    Ok(method)
}

#[cfg(test)]
mod tests {
    use baseline_methods::Method;
    use rigctl::options::values::METHODS;

    #[test]
    fn the_tool_names_every_method() {
        assert_eq!(METHODS.to_vec(), Method::ALL.iter().map(Method::name).collect::<Vec<_>>());
    }
}

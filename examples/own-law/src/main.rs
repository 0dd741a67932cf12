//! The `painleve` command with our laws: `own-law run --set controller.law.impedance.stiffness_n_m=2000`.

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    painleve_command::main_with::<own_law::OurLaws>()
}

#[cfg(target_os = "none")]
compile_error!("build the image with --bin own-law-f405");

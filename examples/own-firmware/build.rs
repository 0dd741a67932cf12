//! Links the program with cortex-m-rt's script, which includes `memory.x`.

fn main() {
    if std::env::var("CARGO_CFG_TARGET_ARCH").as_deref() == Ok("arm") {
        println!("cargo:rustc-link-arg-bins=-Tlink.x");
    }
}

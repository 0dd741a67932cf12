//! Passes the hash of the sources to the crate.

fn main() -> std::io::Result<()> {
    painleve_sources::pass_to_crate()
}

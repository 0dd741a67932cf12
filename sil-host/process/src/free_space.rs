//! Free space of a file system.

use nix::sys::statvfs::statvfs;

/// Returns the free bytes of the file system of `folder`; `None` if it has no limit.
///
/// # Errors
/// If the system cannot report them.
pub fn free_bytes(folder: &str) -> std::io::Result<Option<u64>> {
    let state = statvfs(folder)?;
    let (all, free) = (state.blocks(), state.blocks_available());
    Ok(limited(all, free * state.fragment_size()))
}

/// A `tmpfs` without a limit (`size=0`) reports no blocks at all.
fn limited(blocks: u64, free_bytes: u64) -> Option<u64> {
    (blocks > 0).then_some(free_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_system_without_a_limit_is_not_full() {
        assert_eq!(limited(0, 0), None);
        assert_eq!(limited(100, 0), Some(0));
        assert!(free_bytes("/").is_ok());
        assert!(free_bytes("/no/such/folder").is_err());
    }
}

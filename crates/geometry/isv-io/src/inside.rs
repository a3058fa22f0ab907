//! Names of files that stand in other files: they lead into the folder that was named by the user, and nowhere else.

use std::path::{Component, Path, PathBuf};

/// Path of a name that data gives, from `folder`. `None` if it is absolute, has a drive or goes up. So
/// opening a file from elsewhere reads nothing but what came with it. Links that are in the folder are the
/// user's.
pub(crate) fn inside(folder: &Path, name: &str) -> Option<PathBuf> {
    // A drive is one on this machine or on another.
    let has_drive = name.as_bytes().get(1) == Some(&b':');
    let stays =
        Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let goes_up = name.split(['/', '\\']).any(|part| part == "..");
    // Windows parts names by backslashes; nobody else means one.
    (stays && !goes_up && !has_drive && !name.starts_with('\\')).then(|| folder.join(name.replace('\\', "/")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_in_the_folder() {
        let folder = Path::new("take");
        for name in ["a.png", "./a.png", "depth/a.png", "a b/..c.png"] {
            assert_eq!(inside(folder, name), Some(folder.join(name)), "{name}");
        }
        for name in ["depth\\a.png", ".\\depth\\a.png"] {
            assert_eq!(inside(folder, name), Some(folder.join("depth/a.png")), "{name}");
        }
        for name in [
            "/etc/passwd",
            "../a.png",
            "depth/../../a.png",
            "C:\\a.png",
            "c:a.png",
            "\\\\host\\a",
            "..\\a.png",
            "..",
        ] {
            assert_eq!(inside(folder, name), None, "{name}");
        }
    }
}

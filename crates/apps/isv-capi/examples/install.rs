//! Installs the C library: `cargo run --release -p isv-capi --example install -- PREFIX [DESTDIR]`
//!
//! PREFIX gets `include/isv.h`, the static and the shared library in `lib`, and `lib/pkgconfig/isv.pc`. With DESTDIR, all is written
//! below that folder, as packagers do. Cargo has built the libraries before this program, with its own profile and features.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

const VERSION: &str = env!("CARGO_PKG_VERSION");
const HEADER: &str = include_str!("../include/isv.h");
/// Libraries of the system that the static library needs (`rustc --print native-static-libs`).
const SYSTEM_LIBRARIES: &str = if cfg!(target_os = "macos") {
    "-liconv -lSystem -lc -lm"
} else if cfg!(windows) {
    "-lkernel32 -lntdll -luserenv -lws2_32 -ldbghelp"
} else {
    "-lgcc_s -lutil -lrt -lpthread -lm -ldl -lc"
};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = env::args().skip(1).collect();
    let (prefix, destdir) = match arguments.as_slice() {
        [prefix] => (PathBuf::from(prefix), None),
        [prefix, destdir] => (PathBuf::from(prefix), Some(PathBuf::from(destdir))),
        _ => return Err("name the folder to install to, such as /usr/local".into()),
    };
    if !prefix.is_absolute() {
        return Err(format!("{}: isv.pc needs the whole path", prefix.display()).into());
    }
    let root = match &destdir {
        Some(destdir) => destdir.join(prefix.components().skip(1).collect::<PathBuf>()),
        None => prefix.clone(),
    };
    // target/release/examples/install: the libraries are in target/release/deps.
    let program = env::current_exe()?;
    let built = program.ancestors().nth(2).ok_or("the program is not in a folder of Cargo's")?.join("deps");

    write(&root.join("include/isv.h"), HEADER.as_bytes())?;
    write(&root.join("lib/pkgconfig/isv.pc"), pkg_config(&prefix).as_bytes())?;
    if cfg!(windows) {
        // The name of a DLL is in its import library.
        copy(&built.join("isv_capi.lib"), &root.join("lib/isv_static.lib"))?;
        copy(&built.join("isv_capi.dll.lib"), &root.join("lib/isv.lib"))?;
        return copy(&built.join("isv_capi.dll"), &root.join("bin/isv_capi.dll"));
    }
    copy(&built.join("libisv_capi.a"), &root.join("lib/libisv.a"))?;
    let (shared, names) = shared_names();
    copy(&built.join(shared), &root.join("lib").join(&names[0]))?;
    for link in &names[1..] {
        link_to(&names[0], &root.join("lib").join(link))?;
    }
    println!("isv {VERSION} is in {}", root.display());
    Ok(())
}

/// Name of the shared library as Cargo builds it, and the names that it gets: the first is the file.
fn shared_names() -> (&'static str, [String; 3]) {
    let (major, rest) = VERSION.split_once('.').unwrap_or((VERSION, ""));
    let minor = rest.split('.').next().unwrap_or_default();
    // As build.rs has it.
    let abi = if major == "0" { format!("0.{minor}") } else { major.to_owned() };
    match cfg!(target_os = "macos") {
        true => {
            let names =
                [format!("libisv.{VERSION}.dylib"), format!("libisv.{abi}.dylib"), "libisv.dylib".to_owned()];
            ("libisv_capi.dylib", names)
        }
        false => {
            let names = [format!("libisv.so.{VERSION}"), format!("libisv.so.{abi}"), "libisv.so".to_owned()];
            ("libisv_capi.so", names)
        }
    }
}

fn pkg_config(prefix: &Path) -> String {
    let prefix = prefix.display();
    format!(
        "prefix={prefix}\n\
         libdir=${{prefix}}/lib\n\
         includedir=${{prefix}}/include\n\
         \n\
         Name: isv\n\
         Description: {}\n\
         Version: {VERSION}\n\
         Libs: -L${{libdir}} -lisv\n\
         Libs.private: {SYSTEM_LIBRARIES}\n\
         Cflags: -I${{includedir}}\n",
        "Volumetric video: moving 3-D geometry to small streams and back"
    )
}

/// Writes a file beside its name, and gives it the name when it is whole: programs may be running with the one that is there.
fn write(path: &Path, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
    let named = |error: std::io::Error| format!("{}: {error}", path.display());
    fs::create_dir_all(path.parent().ok_or("no folder")?).map_err(named)?;
    let part = part_of(path);
    fs::write(&part, bytes).map_err(named)?;
    fs::rename(&part, path).map_err(named)?;
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<(), Box<dyn Error>> {
    let bytes = fs::read(from).map_err(|error| format!("{}: {error}", from.display()))?;
    write(to, &bytes)
}

fn part_of(path: &Path) -> PathBuf {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    part.into()
}

#[cfg(unix)]
fn link_to(name: &str, link: &Path) -> Result<(), Box<dyn Error>> {
    let part = part_of(link);
    // One that is left of a run that was killed.
    let _ = fs::remove_file(&part);
    std::os::unix::fs::symlink(name, &part)?;
    fs::rename(&part, link)?;
    Ok(())
}

#[cfg(not(unix))]
fn link_to(name: &str, link: &Path) -> Result<(), Box<dyn Error>> {
    Err(format!("{}: no links to {name} here", link.display()).into())
}

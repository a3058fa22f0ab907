//! What the page may load and run: its `Content-Security-Policy`.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};

/// Everything is from this server: modules, workers, WebAssembly and sockets. The page hands sound to the browser as a blob. Of what
/// stands in the page itself only these very scripts run, which are named by their hashes: an import map cannot be a file.
pub(crate) fn for_page(html: &str) -> String {
    let hashes: String = inline_scripts(html).map(|script| format!(" '{}'", hash(script))).collect();
    format!(
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'{hashes}; worker-src 'self'; connect-src 'self'; \
         style-src 'self'; img-src 'self' data: blob:; media-src blob:; font-src 'self'; base-uri 'none'; form-action 'none'; \
         frame-ancestors 'self'"
    )
}

fn hash(script: &str) -> String {
    format!("sha256-{}", STANDARD.encode(Sha256::digest(script)))
}

/// The texts of the scripts that stand in a page.
fn inline_scripts(html: &str) -> impl Iterator<Item = &str> {
    html.split("<script").skip(1).filter_map(|rest| {
        let (attributes, rest) = rest.split_once('>')?;
        let (script, _) = rest.split_once("</script>")?;
        (!attributes.contains("src=")).then_some(script)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scripts_in_the_page_are_named_and_files_are_not() {
        let html =
            "<script type=\"importmap\">{}</script><script type=\"module\" src=\"src/page.js\"></script>";
        assert_eq!(inline_scripts(html).collect::<Vec<_>>(), ["{}"]);
        // printf '{}' | openssl dgst -sha256 -binary | base64
        assert!(
            for_page(html).contains("'sha256-RBNvo1WzZ4oRRq0W9+hknpT7T8If536DEMBg9hyq/4o='"),
            "{}",
            for_page(html)
        );
    }
}

//! Requests that are answered, and those that are refused.

mod support;

use isv_serve::{Settings, StreamFiles};
use support::{Watcher, ask, ask_as, conformance, hub, live, settings, start};

#[tokio::test]
async fn pages_of_other_sites_cannot_watch() {
    let address =
        start(Settings { allowed_origins: vec!["https://show.example".parse().unwrap()], ..live(&hub()) });
    let own = format!("http://{address}");
    for origin in [None, Some(own.as_str()), Some("https://show.example")] {
        assert!(Watcher::try_join(address, origin).await.is_ok(), "{origin:?}");
    }
    let other_port = format!("http://127.0.0.1:{}", address.port() ^ 1);
    for origin in ["https://evil.example", "null", "http://show.example", &other_port] {
        assert_eq!(Watcher::try_join(address, Some(origin)).await.err(), Some(403), "{origin}");
    }
}

#[tokio::test]
async fn on_loopback_other_names_are_refused_for_everything() {
    let files = StreamFiles::new([conformance("intra.isv")]).unwrap();
    let address = start(Settings { files, ..live(&hub()) });
    let port = address.port();
    for path in ["/", "/src/a.js", "/files/0/intra.isv", "/live", "/nothing"] {
        for host in ["evil.example", "127.0.0.1.evil.example:80", "192.168.0.1"] {
            let answer = ask_as(address, &format!("GET {path}"), &[("Host", host)]).await;
            assert_eq!(answer.status, 403, "{path} as {host}");
        }
        assert!(matches!(ask_as(address, &format!("GET {path}"), &[]).await.status, 400 | 403), "{path}");
    }
    for host in [format!("localhost:{port}"), "localhost:99".to_owned(), format!("[::1]:{port}")] {
        assert_eq!(ask_as(address, "GET /files/0/intra.isv", &[("Host", &host)]).await.status, 200, "{host}");
    }
}

#[tokio::test]
async fn only_allowed_sites_may_read_files() {
    let files = || StreamFiles::new([conformance("intra.isv")]).unwrap();
    let allowed_origins = vec!["https://show.example".parse().unwrap()];
    let shared = start(Settings { files: files(), allowed_origins, ..settings() });
    let path = "GET /files/0/intra.isv";
    let answer = ask(shared, path, &[("Origin", "https://show.example")]).await;
    assert_eq!(answer.header("access-control-allow-origin"), "https://show.example");
    assert!(answer.header("access-control-expose-headers").contains("content-range"));
    let asked = [
        ("Origin", "https://show.example"),
        ("Access-Control-Request-Method", "GET"),
        ("Access-Control-Request-Headers", "range,if-range"),
    ];
    let preflight = ask(shared, "OPTIONS /files/0/intra.isv", &asked).await;
    assert_eq!(preflight.status, 200);
    assert!(preflight.header("access-control-allow-headers").contains("range"));
    let answer = ask(shared, path, &[("Origin", "https://evil.example")]).await;
    assert_eq!(answer.header("access-control-allow-origin"), "");
    let alone = start(Settings { files: files(), ..settings() });
    let answer = ask(alone, path, &[("Origin", "https://show.example")]).await;
    assert_eq!(answer.header("access-control-allow-origin"), "");
}

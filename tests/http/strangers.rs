//! Who may ask a server that others can reach.

use std::process::Command;

use body_schema::server::{Options, Server as Ready, ServerError, Token};
use futures_util::StreamExt;
use reqwest::{Client, Method, StatusCode, redirect::Policy};
use tokio::net::{TcpListener, TcpStream};
use tokio_tungstenite::{client_async, tungstenite::client::IntoClientRequest};
use tokio_util::sync::CancellationToken;

use crate::http::{
    program::Program,
    support::{Api, Server, problem},
};

const TOKEN: &str = "a-token-of-a-test-0123456789";

fn guarded(allow: &[&str]) -> Options {
    Options {
        token: Some(TOKEN.parse::<Token>().expect("a token")),
        allow_hosts: allow.iter().map(|host| host.parse().expect("a name")).collect(),
        ..Options::default()
    }
}

#[tokio::test]
async fn no_server_is_open_to_other_machines_without_a_token() {
    let listener = TcpListener::bind("0.0.0.0:0").await.expect("a free port");
    let refused = Ready::new(listener, Options::default(), CancellationToken::new()).err().expect("refused");
    assert!(matches!(refused, ServerError::Unguarded(_)), "{refused}");
}

#[tokio::test]
async fn only_who_carries_the_token_is_answered() {
    let server = Server::at("0.0.0.0:0", guarded(&[])).await;
    let everything =
        ["/", "/healthz", "/v1/sessions", "/v1/openapi.json", "/page.js", "/viewer/re_viewer.js", "/nothing"];
    for path in everything {
        problem(server.get(path).await, 401, Some("Authorization")).await;
        for wrong in
            ["Bearer", "Bearer wrong", "Basic a-token-of-a-test-0123456789", "Bearer a-token-of-a-test-012345678"]
        {
            let refused = server.request(Method::GET, path).header("authorization", wrong).send().await;
            let refused = refused.expect("an answer");
            assert_eq!(refused.headers()["www-authenticate"], "Bearer");
            problem(refused, 401, Some("Authorization")).await;
        }
    }
    let opening = serde_json::json!({ "scenario": "arm-6dof", "learners": ["random"] });
    problem(server.post("/v1/sessions", opening.clone()).await, 401, Some("Authorization")).await;
    let opened = server.request(Method::POST, "/v1/sessions").bearer_auth(TOKEN).json(&opening).send().await;
    let opened = opened.expect("an answer");
    assert_eq!(opened.status(), StatusCode::CREATED);
    let session = opened.headers()["location"].to_str().expect("text").to_owned();
    for stream in ["events", "live.rrd", "live"] {
        problem(server.get(&format!("{session}/{stream}")).await, 401, Some("Authorization")).await;
    }
    let events = server.request(Method::GET, &format!("{session}/events")).bearer_auth(TOKEN).send().await;
    assert_eq!(events.expect("an answer").status(), StatusCode::OK);

    // A WebSocket by the cookie that a page has.
    let url = format!("ws://{}{session}/live", server.address);
    let stream = TcpStream::connect(server.address).await.expect("a connection");
    assert!(client_async(&url, stream).await.is_err(), "without the token there is none");
    let mut request = url.into_client_request().expect("a request");
    let browser = Client::builder().no_proxy().redirect(Policy::none()).build().expect("a client");
    let sent_on = browser.get(format!("http://{}/?token={TOKEN}", server.address)).send().await.expect("an answer");
    let given = sent_on.headers()["set-cookie"].to_str().expect("text").split(';').next().expect("a pair").to_owned();
    let cookie = format!("other=1; {given}");
    request.headers_mut().insert("cookie", cookie.parse().expect("a header"));
    let stream = TcpStream::connect(server.address).await.expect("a connection");
    let mut socket = client_async(request, stream).await.expect("a WebSocket").0;
    assert!(socket.next().await.expect("a message").is_ok());
    drop(socket);
    server.stop().await;
}

#[tokio::test]
async fn a_page_keeps_the_token_where_no_link_and_no_script_finds_it() {
    let server = Server::at("127.0.0.1:0", guarded(&[])).await;
    let browser = Client::builder().no_proxy().redirect(Policy::none()).build().expect("a client");
    let get =
        async |path: &str| browser.get(format!("http://{}{path}", server.address)).send().await.expect("an answer");
    problem(get("/?token=wrong-but-as-long-as-a-token").await, 401, Some("Authorization")).await;
    problem(get(&format!("/v1/sessions?token={TOKEN}")).await, 401, Some("Authorization")).await;
    let sent_on = get(&format!("/?scenario=arm-6dof&token={TOKEN}&seed=2")).await;
    assert_eq!(sent_on.status(), StatusCode::SEE_OTHER);
    assert_eq!(sent_on.headers()["location"], "/?scenario=arm-6dof&seed=2");
    let cookie = sent_on.headers()["set-cookie"].to_str().expect("text").to_owned();
    for attribute in ["HttpOnly", "SameSite=Strict", "Path=/"] {
        assert!(cookie.contains(attribute), "{cookie}");
    }
    assert_eq!(get(&format!("/?token={TOKEN}")).await.headers()["location"], "/");
    let cookie = cookie.split(';').next().expect("a pair").to_owned();
    let page = browser.get(format!("http://{}/", server.address)).header("cookie", &cookie).send().await;
    let page = page.expect("an answer");
    assert_eq!(page.status(), StatusCode::OK);
    assert!(!page.text().await.expect("text").contains(TOKEN));
    // The token itself is no cookie, nor is the cookie a token, or one of another server.
    assert!(!cookie.contains(TOKEN));
    let (name, pass) = cookie.split_once('=').expect("a pair");
    let forged = server.request(Method::GET, "/healthz").header("cookie", format!("{name}={TOKEN}"));
    problem(forged.send().await.expect("an answer"), 401, Some("Authorization")).await;
    let borne = server.request(Method::GET, "/healthz").bearer_auth(pass);
    problem(borne.send().await.expect("an answer"), 401, Some("Authorization")).await;
    let other = Server::at("127.0.0.1:0", guarded(&[])).await;
    let taken =
        other.request(Method::GET, "/healthz").header("cookie", format!("body-schema-{}={pass}", other.address.port()));
    problem(taken.send().await.expect("an answer"), 401, Some("Authorization")).await;
    other.stop().await;
    // Whoever is known already is sent on without it, too, whatever it is.
    for token in [TOKEN, "wrong-but-as-long-as-a-token"] {
        let again = browser.get(format!("http://{}/?seed=2&token={token}", server.address)).header("cookie", &cookie);
        assert_eq!(again.send().await.expect("an answer").headers()["location"], "/?seed=2", "{token}");
    }
    // The cookie does not help the page of another origin.
    let foreign = server.request(Method::POST, "/v1/sessions").header("cookie", &cookie);
    let foreign = foreign.header("origin", "https://example.org").send().await.expect("an answer");
    problem(foreign, 403, Some("Origin")).await;
    server.stop().await;
}

#[tokio::test]
async fn foreign_names_are_answered_if_they_are_allowed() {
    let server = Server::at("0.0.0.0:0", guarded(&["lab.example.org"])).await;
    let under = async |host: String| {
        let request = server.request(Method::GET, "/healthz").bearer_auth(TOKEN).header("host", host);
        request.send().await.expect("an answer")
    };
    let port = server.address.port();
    for host in ["localhost", "127.0.0.1", "lab.example.org", "LAB.example.org"] {
        assert_eq!(under(format!("{host}:{port}")).await.status(), StatusCode::OK, "{host}");
    }
    for host in ["example.org", "lab.example.org.example.org", "10.1.2.3", ""] {
        problem(under(format!("{host}:{port}")).await, 403, Some("Host")).await;
    }
    server.stop().await;
}

/// The program draws a token for addresses that others can reach, prints it once, and takes one from a file.
#[tokio::test]
async fn the_program_prints_its_token_once_or_reads_one() {
    let serve = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_body-schema"));
        command.args(["serve", "--ephemeral", "--bind"]);
        command
    };
    let mut program = Program::start(serve().arg("0.0.0.0:0"));
    let said: String = (0..3).map(|_| program.line()).collect();
    let token = said.split_once("?token=").expect("an address with the token").1.lines().next().expect("a line");
    let api = Api::at(([127, 0, 0, 1], program.api.address.port()).into());
    problem(api.get("/healthz").await, 401, Some("Authorization")).await;
    let health = async |token: &str| {
        let asked = api.request(Method::GET, "/healthz").bearer_auth(token).send().await;
        asked.expect("an answer").status()
    };
    assert_eq!(health(token).await, StatusCode::OK);
    program.kill();

    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("token");
    std::fs::write(&file, format!("{TOKEN}\n")).expect("written");
    let program = Program::start(serve().args(["127.0.0.1:0", "--token-file"]).arg(&file));
    problem(program.api.get("/healthz").await, 401, Some("Authorization")).await;
    let asked = program.api.request(Method::GET, "/healthz").bearer_auth(TOKEN).send().await.expect("an answer");
    assert_eq!(asked.status(), StatusCode::OK);
    program.kill();
    std::fs::write(&file, "short").expect("written");
    for file in [file, folder.path().join("none")] {
        let refused = serve().args(["127.0.0.1:0", "--token-file"]).arg(&file).output().expect("the program");
        let told = String::from_utf8_lossy(&refused.stderr);
        assert!(!refused.status.success() && told.contains(file.to_str().expect("text")), "{told}");
    }
}

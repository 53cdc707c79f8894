//! Whoever reads may go at any time.
#![cfg(unix)]

use std::{
    io::{Read, Write},
    net::{TcpListener, TcpStream},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

/// The exit code, and standard error, of a command whose standard output nobody reads.
fn unread(arguments: &[&str]) -> (Option<i32>, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_body-schema"));
    let mut program = program.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    drop(program.stdout.take());
    let output = program.wait_with_output().expect("it ends");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_command_that_nobody_reads_ends_quietly() {
    let commands: [&[&str]; 11] = [
        &["--help"],
        &["serve", "--help"],
        &["--version"],
        &["scenarios"],
        &["scenarios", "--json", "-"],
        &["check", "arm-6dof"],
        &["run", "arm-6dof", "--steps", "1"],
        &["run", "arm-6dof", "--steps", "1", "--json", "-"],
        &["compare", "arm-6dof", "--seeds", "1", "--steps", "1"],
        &["observability", "positioner", "--postures", "3"],
        &["calibrate", "positioner", "--json", "-"],
    ];
    for command in commands {
        assert_eq!(unread(command), (Some(0), String::new()), "{command:?}");
    }
}

#[test]
fn who_reads_nothing_still_gets_the_exit_code() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("my.toml");
    let toml =
        include_str!("../../scenarios/tiago-mocap.toml").replace("\"x1\", \"y1\", \"z1\"", "\"x3\", \"y3\", \"z3\"");
    std::fs::write(&path, toml).expect("written");
    for (name, text) in [
        ("tiago-mocap.csv", include_str!("../../scenarios/tiago-mocap.csv")),
        ("tiago-mocap-1504.csv", include_str!("../../scenarios/tiago-mocap-1504.csv")),
    ] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    let path = path.to_str().expect("text");
    let (code, told) = unread(&["check", path, "--strict"]);
    assert!(code == Some(2) && told.contains("about the data"), "{code:?} {told}");
    // Nor does anybody read what is doubted.
    let both = || Command::new(env!("CARGO_BIN_EXE_body-schema"));
    for (arguments, code) in [(&["check", path, "--strict"][..], 2), (&["check", path], 0)] {
        let mut program =
            both().args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
        drop((program.stdout.take(), program.stderr.take()));
        assert_eq!(program.wait().expect("it ends").code(), Some(code), "{arguments:?}");
    }
}

#[test]
fn a_server_that_nobody_reads_serves() {
    let free = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port");
    let mut server = Command::new(env!("CARGO_BIN_EXE_body-schema"))
        .args(["serve", "--ephemeral", "--log", "trace", "--bind", &free.to_string()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    drop((server.stdout.take(), server.stderr.take()));
    let begun = Instant::now();
    let answer = loop {
        assert!(begun.elapsed() < Duration::from_secs(30), "it does not answer");
        assert_eq!(server.try_wait().expect("a server"), None, "it has ended");
        if let Ok(mut stream) = TcpStream::connect(free) {
            let ask = format!("GET /healthz HTTP/1.1\r\nHost: {free}\r\nConnection: close\r\n\r\n");
            stream.write_all(ask.as_bytes()).expect("asked");
            let mut answer = String::new();
            stream.read_to_string(&mut answer).expect("an answer");
            break answer;
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    assert!(Command::new("kill").arg(server.id().to_string()).status().expect("kill").success());
    assert_eq!(server.wait().expect("it ends").code(), Some(0));
}

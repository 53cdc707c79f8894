//! Following a session as it goes: events, the recording, and a WebSocket for both.

use std::{convert::Infallible, sync::Arc, time::Duration};

use axum::{
    body::{Body, Bytes},
    extract::{
        Path, RawQuery, State, WebSocketUpgrade,
        ws::{CloseFrame, Message, WebSocket, rejection::WebSocketUpgradeRejection},
    },
    http::{HeaderMap, header},
    response::{
        IntoResponse, Response,
        sse::{Event, KeepAlive, Sse},
    },
};
use futures_util::{
    Stream, StreamExt,
    stream::{self, unfold},
};
use serde::Serialize;
use serde_json::value::RawValue;
use tokio::{sync::watch, time::sleep};
use utoipa::ToSchema;

use super::{
    readers::{Parts, Reports},
    refusals::OfStreams,
};
use crate::server::{
    App, extract,
    problem::Problem,
    session::{Following, Kept, Snapshot},
};
use body_schema_recording::LiveLog;
use body_schema_wire::{Description, StepReport};

/// Silence after which a comment or a ping shows that the connection still stands.
const KEEP_ALIVE: Duration = Duration::from_secs(15);
/// How long a client may take to hear that its session has ended.
const END_WITHIN: Duration = Duration::from_secs(1);
/// The bytes that a WebSocket buffers beyond the message that it is writing …
const WRITE_BUFFER_BYTES: usize = 8 << 10;
/// … and with it. No message comes near that: parts have one row, or some 256 KiB.
const MOST_BUFFERED_BYTES: usize = 64 << 20;
/// The read buffer: clients have nothing to say, and what they say must not fill the memory.
const READ_BUFFER_BYTES: usize = 1 << 10;
/// The code of a close because the session was deleted …
const CLOSE_DELETED: u16 = 4404;
/// … because its history was rewritten, so that its followers begin anew …
const CLOSE_REWRITTEN: u16 = 4409;
/// … because its engine has failed …
const CLOSE_FAILED: u16 = 4500;
/// … and because the server is ending.
const CLOSE_GOING_AWAY: u16 = 1001;
/// The most characters of a reason, which holds 123 bytes: a character takes up to four.
const CLOSE_REASON_CHARS: usize = 30;

/// A text message of the WebSocket.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[serde(tag = "type", content = "data", rename_all = "lowercase")]
pub(super) enum LiveEvent {
    /// The first message.
    #[schema(value_type = Description)]
    Description(Box<Description>),
    /// One for each step, from the one asked for on.
    #[schema(value_type = StepReport)]
    Step(#[serde(serialize_with = "report")] Arc<RawValue>),
    /// After parts of the recording that were put together: from which part on to resume.
    Parts {
        /// Its index.
        next: usize,
    },
    /// The status of a session with a robot elsewhere, at first and whenever it changes.
    #[schema(value_type = Snapshot)]
    Status(Arc<Snapshot>),
}

fn report<S: serde::Serializer>(report: &Arc<RawValue>, serializer: S) -> Result<S::Ok, S::Error> {
    report.as_ref().serialize(serializer)
}

/// The reports as server-sent events: all from step 0, or all after `Last-Event-ID`, then each as it is made.
///
/// With a robot elsewhere an observation may be excluded or included again, which rewrites the history and ends the stream. Whoever
/// goes on with a `Last-Event-ID` of the old history is sent an event `reset` first, whose data has `rewritten`, how often that has
/// happened, and then all reports of the new one from step 0.
#[utoipa::path(get, path = "/v1/sessions/{id}/events", tag = "sessions", operation_id = "followReports",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("Last-Event-ID" = Option<String>, Header, description = "The id of the last event seen; browsers send it when they reconnect",
            pattern = "^([0-9]{1,15}:)?[0-9]{1,15}$"),
    ),
    responses(
        (status = 200, description = "Events whose data is a StepReport. The id is its step, behind `N:` where the history was rewritten N times. \
            The stream ends with the session.",
            body = String, content_type = "text/event-stream"),
        (status = 400, description = "Last-Event-ID is no id of an event", body = Problem),
        (status = 404, description = "There is no such session", body = Problem),
        OfStreams,
    )
)]
pub(super) async fn events(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?;
    let rewritten = session.rewritten();
    let (first, is_another) = match extract::last_event_id(&headers)? {
        None => (0, false),
        Some((of, last)) if of == rewritten => (last.saturating_add(1), false),
        Some(_) => (0, true),
    };
    let following = session.follow(app.limits.streams_per_session)?;
    let reader = (following, Reports::new(&session, first), Vec::new().into_iter());
    let reset = is_another.then(|| Event::default().event("reset").data(format!("{{\"rewritten\":{rewritten}}}")));
    let events = unfold(reader, move |(following, mut reports, mut batch)| async move {
        let report: Kept = match batch.next() {
            Some(report) => report,
            None => {
                batch = reports.next().await?.into_iter();
                batch.next()?
            }
        };
        let id = match rewritten {
            0 => report.step.to_string(),
            times => format!("{times}:{}", report.step),
        };
        let event = Event::default().id(id).data(report.json.get());
        Some((Ok::<_, Infallible>(event), (following, reports, batch)))
    });
    let events = stream::iter(reset.map(Ok)).chain(events);
    Ok(Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)).into_response())
}

/// The recording as it grows: an .rrd without footer, which `rerun http://…/live.rrd` follows.
#[utoipa::path(get, path = "/v1/sessions/{id}/live.rrd", tag = "sessions", operation_id = "followRecording",
    params(("id" = String, Path, description = "The session's id", format = "uuid")),
    responses(
        (status = 200, description = "The recording so far, then all that is added to it. The stream ends with the session.",
            body = Vec<u8>, content_type = "application/octet-stream"),
        (status = 404, description = "There is no such session", body = Problem),
        OfStreams,
    )
)]
pub(super) async fn live_recording(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?;
    let following = session.follow(app.limits.streams_per_session)?;
    let body = Body::from_stream(parts(following, Parts::new(&session, 0, LiveLog::batch_from)));
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], body).into_response())
}

fn parts(following: Following, parts: Parts) -> impl Stream<Item = Result<Bytes, Infallible>> {
    unfold((following, parts, Vec::new().into_iter()), |(following, mut parts, mut batch)| async {
        let part: Bytes = match batch.next() {
            Some(part) => part,
            None => {
                batch = parts.next().await?.into_iter();
                batch.next()?
            }
        };
        Some((Ok(part), (following, parts, batch)))
    })
}

/// Everything over one WebSocket, for a page: reports as text (LiveEvent), the recording as binary messages.
///
/// A binary message is one part of the recording: part 0 is the 12-byte header of an .rrd stream, and any part after it
/// makes a valid stream with the header in front. Views are arranged for the scene alone, as a page has curves of its
/// own. Whoever asks for a long recording from part 0 on gets what there is of it put together in a few messages, after each of
/// which a `parts` event says from which part on to resume. A report comes after the part that records it. Who takes nothing
/// of what is sent for a while is given up, and may resume.
#[utoipa::path(get, path = "/v1/sessions/{id}/live", tag = "sessions", operation_id = "followSession",
    params(
        ("id" = String, Path, description = "The session's id", format = "uuid"),
        ("from" = Option<u64>, Query, description = "The first part of the recording to send; 0 if absent"),
        ("step" = Option<u64>, Query, description = "The first step to report; 0 if absent"),
    ),
    responses(
        (status = 101, description = "The WebSocket. Its close code says why it ended: 4404 the session was deleted, \
            4409 an observation was excluded or included, so that all is to be followed anew from the first part and step 0, \
            4500 its engine has failed, 1001 the server is shutting down."),
        (status = 400, description = "Not a WebSocket handshake, or a parameter is not a number", body = Problem),
        (status = 403, description = "The request comes from a foreign page", body = Problem),
        (status = 404, description = "There is no such session", body = Problem),
        (status = 426, description = "The connection cannot be upgraded", body = Problem),
        OfStreams,
    )
)]
pub(super) async fn live(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id).await?;
    let [from, step] = extract::whole_numbers(query.as_deref(), ["from", "step"])?;
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(rejection) => return Ok(rejection.into_response()),
    };
    let following = session.follow(app.limits.streams_per_session)?;
    let reports = Reports::new(&session, step.unwrap_or(0));
    let parts = Parts::new(&session, from.unwrap_or(0), LiveLog::scene_batch_from);
    let (description, standing) = (session.description().clone(), session.standing());
    let upgrade = upgrade
        .max_message_size(READ_BUFFER_BYTES)
        .max_frame_size(READ_BUFFER_BYTES)
        .read_buffer_size(READ_BUFFER_BYTES)
        .write_buffer_size(WRITE_BUFFER_BYTES)
        .max_write_buffer_size(MOST_BUFFERED_BYTES);
    Ok(upgrade.on_upgrade(async move |socket| {
        let ended = async {
            following.ended().cancelled().await;
            sleep(END_WITHIN).await;
        };
        // A client that goes away needs no answer, and one that does not read hears none.
        tokio::select! {
            _ = follow(socket, &app, description, standing, (reports, parts)) => {}
            () = ended => {}
        }
    }))
}

async fn follow(
    mut socket: WebSocket,
    app: &App,
    description: Description,
    mut standing: watch::Receiver<Option<Arc<Snapshot>>>,
    (mut reports, mut parts): (Reports, Parts),
) -> Result<(), axum::Error> {
    socket.send(text(&LiveEvent::Description(Box::new(description)))?).await?;
    if let Some((header, together)) = parts.together().await {
        socket.send(Message::Binary(header)).await?;
        let (last, others) = together.parts.split_last().unzip();
        for part in others.unwrap_or_default() {
            socket.send(Message::Binary(part.clone())).await?;
            // Without the rest it holds nothing whole: single parts, all but the header, are to come then.
            socket.send(text(&LiveEvent::Parts { next: 1 })?).await?;
        }
        socket.send(Message::Binary(last.cloned().unwrap_or_default())).await?;
        socket.send(text(&LiveEvent::Parts { next: together.next })?).await?;
    }
    // What it is now, as if it had just changed.
    standing.mark_changed();
    let live = parts.live().clone();
    let mut ping = tokio::time::interval_at(tokio::time::Instant::now() + KEEP_ALIVE, KEEP_ALIVE);
    loop {
        // Parts first: they are published before the reports of their steps.
        tokio::select! {
            biased;
            message = socket.recv() => if message.transpose()?.is_none() { return Ok(()) },
            batch = parts.next() => match batch {
                Some(batch) => send_parts(&mut socket, batch).await?,
                None => break,
            },
            batch = async { live.caught_up().await; reports.next().await } => {
                // Both may have come since the parts were asked for.
                let published = parts.published();
                while parts.next_index() < published {
                    let ready = parts.ready();
                    send_parts(&mut socket, ready).await?;
                }
                for report in batch.into_iter().flatten() {
                    socket.send(text(&LiveEvent::Step(report.json))?).await?;
                }
            }
            // Its sender lives as long as the session, whose end the readers hear of.
            Ok(()) = standing.changed() => {
                let now = standing.borrow_and_update().clone();
                if let Some(now) = now {
                    socket.send(text(&LiveEvent::Status(now))?).await?;
                }
            }
            _ = ping.tick() => socket.send(Message::Ping(Bytes::new())).await?,
        }
    }
    while let Some(batch) = reports.next().await {
        for report in batch {
            socket.send(text(&LiveEvent::Step(report.json))?).await?;
        }
    }
    let (code, reason) = match reports.failure() {
        _ if app.sessions.is_shutting_down() => (CLOSE_GOING_AWAY, "the server is shutting down".to_owned()),
        _ if reports.is_rewritten() => (CLOSE_REWRITTEN, "what was told counts anew".to_owned()),
        Some(failure) => (CLOSE_FAILED, failure.chars().take(CLOSE_REASON_CHARS).collect()),
        None => (CLOSE_DELETED, "the session was deleted".to_owned()),
    };
    socket.send(Message::Close(Some(CloseFrame { code, reason: reason.into() }))).await
}

async fn send_parts(socket: &mut WebSocket, batch: Vec<Bytes>) -> Result<(), axum::Error> {
    for part in batch {
        socket.send(Message::Binary(part)).await?;
    }
    Ok(())
}

fn text(event: &LiveEvent) -> Result<Message, axum::Error> {
    serde_json::to_string(event).map(|text| Message::Text(text.into())).map_err(axum::Error::new)
}

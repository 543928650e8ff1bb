//! The boundary of the module: three functions and the memory between them.

// Exported functions are called from outside alone.
#![allow(unsafe_code, unreachable_pub)]

use crate::question::Question;
use crate::session::Session;
use serde_json::json;
use std::cell::RefCell;

/// Memory that the page writes into and reads from, and the specification that is open.
#[derive(Default)]
struct State {
    question: Vec<u8>,
    answer: Vec<u8>,
    session: Option<Session>,
}

thread_local! {
    static STATE: RefCell<State> = RefCell::default();
}

/// Lends memory for a question of `length` bytes.
#[unsafe(no_mangle)]
pub extern "C" fn room(length: u32) -> *mut u8 {
    STATE.with_borrow_mut(|state| {
        state.question.clear();
        state.question.resize(length as usize, 0);
        state.question.as_mut_ptr()
    })
}

/// Answers the question that was written into [`room`]: where the answer begins.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    STATE.with_borrow_mut(|state| {
        let State { question, answer, session } = state;
        *answer = match serde_json::from_slice::<Question>(question) {
            Ok(question) => question.answer(session),
            Err(error) => {
                let message = format!("this is no question: {error}");
                json!({ "error": { "message": message } }).to_string().into_bytes()
            }
        };
        answer.as_ptr()
    })
}

/// The length of the answer in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn length() -> u32 {
    STATE.with_borrow(|state| state.answer.len() as u32)
}

"""Questions and their answers on the way between processes that share a database."""

from __future__ import annotations

from sqlalchemy import Connection, delete, insert, select, update

from lineloom_service.store.database import notify
from lineloom_service.store.tables import questions


def post_question(connection: Connection, key: str, question: bytes) -> None:
    """Put a question."""
    connection.execute(insert(questions).values(id=key, question=question))
    notify(connection, f"question {key}")


def read_question(connection: Connection, key: str) -> bytes | None:
    """Return a question that has no answer yet."""
    c = questions.c
    query = select(c.question).where(c.id == key, c.answer.is_(None))
    return connection.execute(query).scalar()


def post_answer(connection: Connection, key: str, answer: bytes) -> None:
    """Answer a question, if anyone still waits."""
    connection.execute(update(questions).where(questions.c.id == key).values(answer=answer))
    notify(connection, f"answer {key}")


def take_answer(connection: Connection, key: str) -> bytes | None:
    """Return the answer and forget both; None while there is none."""
    answer = connection.execute(select(questions.c.answer).where(questions.c.id == key)).scalar()
    if answer is not None:
        connection.execute(delete(questions).where(questions.c.id == key))
    return answer


def drop_questions(connection: Connection) -> None:
    """Forget all: whoever was to answer them is gone."""
    connection.execute(delete(questions))

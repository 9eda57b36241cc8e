"""Robots take turns in order, questions get in between, and alone nobody waits."""

from __future__ import annotations

import asyncio

from lineloom_service.pacing import Pacer


async def test_in_the_order_asked_for_a_few_in_every_go() -> None:
    pacer, order = Pacer(), list[int]()
    goes = 0

    async def robot(number: int) -> None:
        await pacer.turn()
        order.append(number)

    tasks = [asyncio.create_task(robot(number)) for number in range(31)]
    while not all(task.done() for task in tasks):
        before = len(order)
        await asyncio.sleep(0)
        goes += 1
        assert len(order) - before <= 4
    assert order == list(range(31))
    assert goes <= 40  # nor are they held up for nothing


async def test_a_question_does_not_wait_for_all_robots() -> None:
    pacer, done = Pacer(), list[str]()

    async def robot() -> None:
        await pacer.turn()
        done.append("robot")

    async def question() -> None:
        done.append("question")

    tasks = [asyncio.create_task(robot()) for _ in range(100)]
    await asyncio.sleep(0)
    tasks.append(asyncio.create_task(question()))
    await asyncio.gather(*tasks)
    assert done.index("question") < 10


async def test_alone_there_is_nothing_to_wait_for() -> None:
    pacer = Pacer()
    turn = pacer.turn()
    try:
        turn.send(None)  # runs to its end without giving the loop back
    except StopIteration:
        return
    raise AssertionError("it waited")


async def test_whoever_goes_away_costs_nobody_a_turn() -> None:
    pacer = Pacer()
    tasks = [asyncio.create_task(pacer.turn()) for _ in range(20)]
    await asyncio.sleep(0)
    for task in tasks[3:15]:
        task.cancel()
    results = await asyncio.wait_for(asyncio.gather(*tasks, return_exceptions=True), 5.0)
    assert sum(isinstance(result, asyncio.CancelledError) for result in results) == 12
    await asyncio.wait_for(pacer.turn(), 5.0)

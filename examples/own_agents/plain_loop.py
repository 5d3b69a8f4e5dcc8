"""An agent without a framework: one question a tick, an answer in JSON. Its calls are recorded, billed and replayed.

lingjing run ssr --policy examples/own_agents/plain_loop.py --policy-arg model=gpt-5.4 --max-cost 1
"""

from lingjing.plugins.asking import AskOptions, ask
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.decisions import DecisionFormat
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation


class PlainAgent:
    calls, options = True, AskOptions

    def __init__(self, options: AskOptions, calls: ModelCalls) -> None:
        self.model = ask(options, calls)

    async def reset(self, brief: Brief) -> None:
        self.form = DecisionFormat(brief)
        self.system = f"You are {brief.agent}. {brief.goal}\n{brief.prompt}\nAnswer with JSON: {self.form.schema}"

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        state = f"tick {observation.tick}: {observation.entities} {inbox.messages} {inbox.receipts}"
        images = [picture.jpeg for picture in observation.pictures]
        return self.form.read(await self.model(state, images=images, system=self.system))

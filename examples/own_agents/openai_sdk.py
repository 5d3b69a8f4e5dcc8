"""An agent over the OpenAI SDK: the client's address is a server on loopback that records each request as it is.

lingjing run ssr --policy examples/own_agents/openai_sdk.py --policy-arg model=gpt-5.4 --max-cost 1
"""

from openai import AsyncOpenAI

from lingjing.plugins.asking import AskOptions, serve_models
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.decisions import DecisionFormat
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation


class SdkAgent:
    calls, options = True, AskOptions

    def __init__(self, options: AskOptions, calls: ModelCalls) -> None:
        server = serve_models(options, calls)
        self.name, self.client = options.model, AsyncOpenAI(base_url=server.url, api_key=server.key, max_retries=0)

    async def reset(self, brief: Brief) -> None:
        self.form = DecisionFormat(brief)
        system = f"You are {brief.agent}. {brief.goal}\n{brief.prompt}\nAnswer with JSON: {self.form.schema}"
        self.turns = [{"role": "system", "content": system}]

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        state = f"tick {observation.tick}: {observation.entities} {inbox.messages} {inbox.receipts}"
        turns = [*self.turns, {"role": "user", "content": state}]
        answer = await self.client.chat.completions.create(model=self.name, messages=turns)
        return self.form.read(answer.choices[0].message.content or "")

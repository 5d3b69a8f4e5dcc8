"""An agent of Inspect: its loop of answers and tool calls, over the recording server on loopback.

lingjing run ssr --policy examples/own_agents/inspect_agent.py --policy-arg model=gpt-5.4 --max-cost 1
"""

from inspect_ai.agent import Agent, AgentState, agent, run
from inspect_ai.model import ChatMessageSystem, ChatMessageUser, Model, get_model

from lingjing.plugins.asking import AskOptions, serve_models
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.decisions import DecisionFormat
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation


@agent
def pilot(model: Model) -> Agent:
    async def execute(state: AgentState) -> AgentState:
        state.messages, state.output = await model.generate_loop(state.messages)
        return state

    return execute


class InspectAgent:
    calls, options = True, AskOptions

    def __init__(self, options: AskOptions, calls: ModelCalls) -> None:
        self.server, self.name = serve_models(options, calls), f"openai/{options.model}"

    async def reset(self, brief: Brief) -> None:
        self.form = DecisionFormat(brief)
        self.system = f"You are {brief.agent}. {brief.goal}\n{brief.prompt}\nAnswer with JSON: {self.form.schema}"

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        state = f"tick {observation.tick}: {observation.entities} {inbox.messages} {inbox.receipts}"
        access = {"base_url": self.server.url, "api_key": self.server.key, "responses_api": False, "memoize": False}
        model = get_model(self.name, **access)
        ended = await run(pilot(model), [ChatMessageSystem(content=self.system), ChatMessageUser(content=state)])
        return self.form.read(ended.output.completion)
